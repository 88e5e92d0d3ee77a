#include "plumb/runtime/line_selection.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "plumb/geometry/line_projection.h"
#include "plumb/map/depth_view.h"
#include "plumb/runtime/covariance_factor.h"

namespace plumb {
namespace {

constexpr double kLengthCapPx = 150.0;
constexpr double kMinLengthPx = 15.0;

constexpr size_t kMaxSearchLines = 300, kMaxAlignmentLines = 250, kMaxLocalLines = 400;
constexpr uint32_t kAlignmentKeyFrames = 5;
constexpr size_t kFewLines = 30;

// Margins around the image: lists for a fixed pose need less than those for an uncertain one.
constexpr double kSearchMarginPx = 100.0, kSearchMarginPxPerRad = 400.0;
constexpr double kRankMarginPx = 30.0;
const VisibilityOptions kVisibility;

// Of a lifted end point: its depth's deviation moves it along its ray, its pixels' across it.
constexpr DepthNoise kDepthNoise;
constexpr double kPixelSigma = 0.7;

Eigen::Matrix3d LiftedCovariance(const KeyFrame& key_frame, const Eigen::Vector3d& axis,
                                 const Eigen::Vector3d& center, const Eigen::Vector3d& x_in_world) {
  const Eigen::Vector3d ray = x_in_world - center;
  const double depth = axis.dot(ray);
  const double across = kPixelSigma * depth / key_frame.camera.MeanFocal();
  const double relative = kDepthNoise.SigmaAt(depth) / depth;
  return across * across * Eigen::Matrix3d::Identity() +
         (relative * relative - across * across / ray.squaredNorm()) * ray * ray.transpose();
}

// Seen from about the same side and distance as in the key frame that lifted it.
bool IsSeenAlike(const Eigen::Vector3d& midpoint, const Eigen::Vector3d& key_frame_center,
                 const Eigen::Vector3d& center) {
  const Eigen::Vector3d a = key_frame_center - midpoint, b = center - midpoint;
  const double distance_a = a.norm(), distance_b = b.norm();
  static const double kMinCosine = std::cos(kVisibility.max_view_angle_rad);
  return a.dot(b) > kMinCosine * distance_a * distance_b &&
         distance_a < kVisibility.max_distance_ratio * distance_b &&
         distance_b < kVisibility.max_distance_ratio * distance_a;
}

constexpr double kReusePositionM = 0.05, kReuseRotationRad = 0.035;

}  // namespace

double LineWeight(const MapLine& line) {
  const double observing = line.num_observing;
  const double stability = observing / std::max<double>({line.num_expected * 1.0, observing, 1.0});
  return (0.3 + 0.7 * std::min(1.0, 1.5 * stability)) * std::min(1.0, observing / 3.0);
}

void LineSelector::KeepBest(size_t max_lines) {
  const size_t kept = std::min(max_lines, ranked_.size());
  const auto is_better = [](const Ranked& a, const Ranked& b) {
    return a.value != b.value ? a.value > b.value : a.id < b.id;
  };
  if (kept < ranked_.size()) {
    std::nth_element(ranked_.begin(), ranked_.begin() + static_cast<ptrdiff_t>(kept), ranked_.end(),
                     is_better);
    ranked_.resize(kept);
  }
  std::sort(ranked_.begin(), ranked_.end(), is_better);
}

void LineSelector::AppendFused(size_t max_lines, std::vector<CandidateLine>* out) {
  const LineMap& map = index_.map();
  ranked_.clear();
  for (const VisibleLine& visible : visible_) {
    const double length = static_cast<double>(visible.length_px);
    ranked_.push_back(
        {std::min(length, kLengthCapPx) * LineWeight(map.lines[visible.line]), visible.line});
  }
  KeepBest(max_lines);
  out->clear();
  for (const Ranked& entry : ranked_) {
    const MapLine& line = map.lines[entry.id];
    out->push_back({.segment_in_world = line.segment_in_world,
                    .weight = LineWeight(line),
                    .covariance_start = line.covariance_start,
                    .covariance_end = line.covariance_end,
                    .id = entry.id});
  }
}

void LineSelector::SelectForSearch(const Camera& camera, const Rigid3& cam_from_world,
                                   double rotation_sigma_rad, std::vector<CandidateLine>* out) {
  VisibilityOptions options = kVisibility;
  options.margin_px = kSearchMarginPx + kSearchMarginPxPerRad * rotation_sigma_rad;
  options.min_length_px = kMinLengthPx;
  index_.VisibleLines(camera, cam_from_world, options, &visible_);
  AppendFused(kMaxSearchLines, out);
}

void LineSelector::SelectForAlignment(const Camera& camera, const Rigid3& cam_from_world,
                                      std::vector<CandidateLine>* out) {
  VisibilityOptions options = kVisibility;
  options.min_length_px = kMinLengthPx;
  options.nearest_key_frames = kAlignmentKeyFrames;
  index_.VisibleLines(camera, cam_from_world, options, &visible_);
  if (visible_.size() < kFewLines) {
    options.nearest_key_frames = 0;
    index_.VisibleLines(camera, cam_from_world, options, &visible_);
  }
  AppendFused(kMaxAlignmentLines, out);
}

void LineSelector::SelectLocal(const Camera& camera, const Rigid3& cam_from_world,
                               std::vector<CandidateLine>* out) {
  const LineMap& map = index_.map();
  index_.NearestKeyFrames(cam_from_world, kLocalKeyFrames, &key_frames_);
  const Eigen::Vector3d center = cam_from_world.Center();
  const Eigen::Matrix3d rotation = cam_from_world.RotationMatrix();
  ranked_.clear();
  uint32_t id = 0;
  for (const uint32_t k : key_frames_) {
    const KeyFrame& key_frame = map.key_frames[k];
    const Eigen::Vector3d key_frame_center = key_frame.cam_from_world.Center();
    for (const LiftedSegment& lifted : key_frame.segments) {
      const uint32_t this_id = id++;
      const Segment3& segment = lifted.segment_in_world;
      if (!IsSeenAlike(segment.Midpoint(), key_frame_center, center)) continue;
      const auto image = ProjectSegmentInCam(camera,
                                             {rotation * segment.start + cam_from_world.translation,
                                              rotation * segment.end + cam_from_world.translation},
                                             kRankMarginPx);
      const double length = image ? image->Length() : 0.0;
      if (!(length > kMinLengthPx)) continue;
      ranked_.push_back({std::min(length, kLengthCapPx), this_id});
    }
  }
  KeepBest(kMaxLocalLines);
  std::array<Eigen::Vector3d, kLocalKeyFrames> centers, axes;
  for (size_t k = 0; k < key_frames_.size(); ++k) {
    const Rigid3& pose = map.key_frames[key_frames_[k]].cam_from_world;
    centers[k] = pose.Center();
    axes[k] = pose.RotationMatrix().row(2);
  }
  out->clear();
  for (const Ranked& entry : ranked_) {
    uint32_t offset = entry.id;
    size_t k = 0;
    while (offset >= map.key_frames[key_frames_[k]].segments.size()) {
      offset -= static_cast<uint32_t>(map.key_frames[key_frames_[k++]].segments.size());
    }
    const KeyFrame& key_frame = map.key_frames[key_frames_[k]];
    const Segment3& segment = key_frame.segments[offset].segment_in_world;
    const Eigen::Vector3d& seen_from = centers[k];
    out->push_back(
        {.segment_in_world = segment,
         .weight = 1.0,
         .covariance_start = LiftedCovariance(key_frame, axes[k], seen_from, segment.start),
         .covariance_end = LiftedCovariance(key_frame, axes[k], seen_from, segment.end),
         .id = entry.id});
  }
}

const std::vector<CandidateLine>& FineLines::Near(const Camera& camera,
                                                  const Rigid3& cam_from_world) {
  if (selected_at_) {
    const PoseDistance distance = DistanceBetween(cam_from_world, *selected_at_);
    if (distance.position_m < kReusePositionM && distance.rotation_rad < kReuseRotationRad) {
      return lines_;
    }
  }
  selector_.SelectForAlignment(camera, cam_from_world, &lines_);
  selected_at_ = cam_from_world;
  return lines_;
}

}  // namespace plumb
