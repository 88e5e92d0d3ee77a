#include "plumb/map/lift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include "plumb/map/lift_side.h"

namespace plumb {
namespace {

constexpr double kFewDepths = 0.3;          // share of samples: the other side says nothing
constexpr double kNearerBy = 0.01;          // [1/m]
constexpr int kMaxGap = kLiftColumns / 10;  // columns
constexpr int kMinColumns = 6;
constexpr double kMinInverseDepth = 0.1, kMaxInverseDepth = 4.0;  // [1/m] at the kept end points

using ColumnShare = std::array<float, kLiftColumns>;

// The surface that the segment is drawn on or bounds.
struct Owner {
  double inverse_depth = 0.0;  // at u = 0.5 [1/m]
  double slope = 0.0;          // along the segment [1/m per segment]
  ColumnShare column_share{};

  double InverseDepthAt(double u) const { return inverse_depth + slope * (u - 0.5); }
};

Owner OwnedBy(const LiftSide& side) { return {side.plane[0], side.plane[1], side.column_share}; }

bool SameSurface(const LiftSide& a, const LiftSide& b, double tolerance) {
  return std::abs(a.InverseDepthAt(0.0) - b.InverseDepthAt(0.0)) < tolerance &&
         std::abs(a.InverseDepthAt(1.0) - b.InverseDepthAt(1.0)) < tolerance;
}

std::optional<Owner> FindOwner(const LiftSide& a, const LiftSide& b, double same_tolerance) {
  if (a.IsSurface() && b.IsSurface()) {
    if (!SameSurface(a, b, same_tolerance)) return OwnedBy(b.plane[0] > a.plane[0] ? b : a);
    Owner mean{0.5 * (a.plane[0] + b.plane[0]), 0.5 * (a.plane[1] + b.plane[1]), {}};
    for (int k = 0; k < kLiftColumns; ++k) {
      mean.column_share[k] = std::max(a.column_share[k], b.column_share[k]);
    }
    return mean;
  }
  if (!a.IsSurface() && !b.IsSurface()) return std::nullopt;
  const LiftSide& surface = a.IsSurface() ? a : b;
  const LiftSide& other = a.IsSurface() ? b : a;
  // Something nearer that is not a plane may own the edge: then its place is unknown.
  const bool other_is_behind =
      other.valid_share < kFewDepths || other.median_inverse_depth < surface.plane[0] + kNearerBy;
  if (!other_is_behind) return std::nullopt;
  return OwnedBy(surface);
}

struct Run {
  int begin = 0, end = 0;  // columns, half open
};

// The longest stretch of supported columns, first of equals; gaps of up to kMaxGap are bridged.
Run LongestRun(const ColumnShare& column_share) {
  Run best, run;
  for (int k = 0; k < kLiftColumns; ++k) {
    if (!(column_share[k] > 0.5f)) continue;
    if (run.end == 0 || k - (run.end - 1) > kMaxGap + 1) run.begin = k;
    run.end = k + 1;
    if (run.end - run.begin > best.end - best.begin) best = run;
  }
  return best;
}

}  // namespace

std::vector<LiftedPart> LiftSegments(const Camera& camera, const DepthView& depth,
                                     std::span<const Segment2> segments, const LiftOptions& options,
                                     const Rectifier* rectifier) {
  if (rectifier != nullptr && rectifier->IsIdentity()) rectifier = nullptr;
  std::vector<LiftedPart> lifted;
  lifted.reserve(segments.size());
  for (uint32_t i = 0; i < segments.size(); ++i) {
    const Segment2& segment = segments[i];
    const double length = segment.Length();
    if (!(std::isfinite(length) && length >= options.min_length_px)) continue;

    const std::optional<Owner> owner = FindOwner(
        FitLiftSide(depth, segment, -1, options, rectifier),
        FitLiftSide(depth, segment, +1, options, rectifier), options.same_surface_tolerance);
    if (!owner) continue;
    const Run run = LongestRun(owner->column_share);
    const double u0 = static_cast<double>(run.begin) / kLiftColumns;
    const double u1 = static_cast<double>(run.end) / kLiftColumns;
    if (run.end - run.begin < kMinColumns || (u1 - u0) * length < options.min_length_px) continue;

    const auto in_range = [](double inverse_depth) {
      return inverse_depth >= kMinInverseDepth && inverse_depth <= kMaxInverseDepth;
    };
    const double inverse0 = owner->InverseDepthAt(u0), inverse1 = owner->InverseDepthAt(u1);
    if (!in_range(inverse0) || !in_range(inverse1)) continue;

    LiftedPart part;
    part.source = i;
    part.segment_px = {segment.start + u0 * segment.Delta(), segment.start + u1 * segment.Delta(),
                       segment.score};
    const auto at_depth = [&camera](const Eigen::Vector2d& px, double inverse_depth) {
      return Eigen::Vector3d(camera.Normalize(px).homogeneous() / inverse_depth);
    };
    part.segment_in_cam = {at_depth(part.segment_px.start, inverse0),
                           at_depth(part.segment_px.end, inverse1)};
    if (part.segment_in_cam.Length() > options.max_length_m) continue;
    lifted.push_back(part);
  }
  return lifted;
}

}  // namespace plumb
