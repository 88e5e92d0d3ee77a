// How well a detector finds the same segments from another viewpoint, with depth and true poses.
#include "tools/metrics/repeatability.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "plumb/geometry/line_projection.h"
#include "plumb/map/lift.h"

namespace plumb::tools {
namespace {

constexpr double kMinLengthPx = 20.0;
constexpr double kMaxSine = 0.087;
constexpr double kMinOverlap = 0.5;  // of the expected segment
constexpr double kFoundPx = 2.0, kErrorPx = 5.0;
constexpr int kDepthSamples = 16;
constexpr int kDepthReachPx = 2;  // the edge itself has torn depth

/// The farthest depth around a pixel; 0 if there is none.
double FarthestDepth(const DepthView& depth, const Eigen::Vector2d& px) {
  const int cx = static_cast<int>(std::lround(px.x())), cy = static_cast<int>(std::lround(px.y()));
  double farthest = 0.0;
  for (int y = std::max(cy - kDepthReachPx, 0);
       y <= std::min(cy + kDepthReachPx, depth.height_px - 1); ++y) {
    for (int x = std::max(cx - kDepthReachPx, 0);
         x <= std::min(cx + kDepthReachPx, depth.width_px - 1); ++x) {
      farthest = std::max(farthest, static_cast<double>(depth.MetresAt(x, y)));
    }
  }
  return farthest;
}

/// Whether half or more of the segment lies behind what `depth` shows.
bool IsOccluded(const Rectifier& rectifier, const DepthView& depth,
                const Segment3& segment_in_cam) {
  int num_hidden = 0, num_inside = 0;
  for (int i = 0; i < kDepthSamples; ++i) {
    const double share = (i + 0.5) / kDepthSamples;
    const Eigen::Vector3d point = segment_in_cam.start + share * segment_in_cam.Delta();
    if (point.z() < kNearPlane) continue;
    const auto image = rectifier.ToImage(rectifier.ideal().Project(point));
    if (!image || !rectifier.image_camera().pinhole.Contains(image->px)) continue;
    const Eigen::Vector2d& px = image->px;
    ++num_inside;
    const double seen = FarthestDepth(depth, px);
    const double tolerance = 3.0 * DepthNoise().SigmaAt(point.z()) + 0.02;
    if (seen > 0.0 && seen < point.z() - tolerance) ++num_hidden;
  }
  return 2 * num_hidden >= num_inside;
}

/// Distances of a detected segment from the expected one where the two lie side by side.
struct Gap {
  double mean_px = 0.0;       // mean of the distances at both ends
  double worst_end_px = 0.0;  // at the worse end
};

/// @return nullopt if the directions differ or too little is shared.
std::optional<Gap> GapBetween(const Segment2& expected, const Segment2& detected) {
  const double length = expected.Length(), other_length = detected.Length();
  if (length <= 0.0 || other_length <= 0.0) return std::nullopt;
  const Eigen::Vector2d along = expected.Delta() / length;
  const auto cross = [&](const Eigen::Vector2d& v) {
    return along.x() * v.y() - along.y() * v.x();
  };
  if (std::abs(cross(detected.Delta())) >= kMaxSine * other_length) return std::nullopt;
  // Positions along and across of the detected ends, in the expected segment's own frame.
  double a = along.dot(detected.start - expected.start),
         da = cross(detected.start - expected.start);
  double b = along.dot(detected.end - expected.start), db = cross(detected.end - expected.start);
  if (a > b) {
    std::swap(a, b);
    std::swap(da, db);
  }
  const double begin = std::max(a, 0.0), end = std::min(b, length);
  if (end - begin <= kMinOverlap * length) return std::nullopt;
  const double slope = (db - da) / (b - a);
  const double at_begin = da + slope * (begin - a), at_end = da + slope * (end - a);
  return Gap{0.5 * (std::abs(at_begin) + std::abs(at_end)),
             std::max(std::abs(at_begin), std::abs(at_end))};
}

}  // namespace

void AddPair(const Rectifier& rectifier, const RepeatabilityView& first,
             const RepeatabilityView& second, RepeatabilityTally* tally) {
  ++tally->num_pairs;
  const Camera& camera = rectifier.ideal();
  const Rigid3 second_from_first = second.cam_from_world * first.cam_from_world.Inverse();
  for (const LiftedPart& part : LiftSegments(camera, first.depth, first.segments, {}, &rectifier)) {
    const Segment3 in_second{second_from_first * part.segment_in_cam.start,
                             second_from_first * part.segment_in_cam.end};
    const std::optional<Segment2> expected = ProjectSegmentInCam(camera, in_second);
    if (!expected || expected->Length() <= kMinLengthPx) continue;
    if (IsOccluded(rectifier, second.depth, in_second)) continue;
    ++tally->num_expected;
    bool found = false;
    double nearest_px = kErrorPx;
    for (const Segment2& detected : second.segments) {
      const std::optional<Gap> gap = GapBetween(*expected, detected);
      if (!gap || gap->worst_end_px >= kErrorPx) continue;
      nearest_px = std::min(nearest_px, gap->mean_px);
      found |= gap->worst_end_px < kFoundPx;
    }
    if (found) ++tally->num_found;
    if (nearest_px < kErrorPx) tally->errors_px.push_back(nearest_px);
  }
}

}  // namespace plumb::tools
