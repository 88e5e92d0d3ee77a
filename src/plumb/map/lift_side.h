// The surface beside a segment: a plane in inverse depth, fitted to the depth on one of its sides.
#pragma once

#include <array>

#include <Eigen/Core>

#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/depth_view.h"
#include "plumb/map/lift.h"

namespace plumb {

/// Samples along a segment at which its sides are looked at.
inline constexpr int kLiftColumns = 40;

/// What one side says. The inverse depth of a plane is affine in pixel coordinates:
/// 1/z = plane . (1, u - 0.5, o / 10) with u = 0..1 along the segment and o [px] across it; with a
/// lens o is in pixels of the taken image at the segment's middle.
struct LiftSide {
  Eigen::Vector3d plane = Eigen::Vector3d::Zero();  // [1/m]
  double valid_share = 0.0;                         // samples that have a depth, 0..1
  double inlier_share = 0.0;                        // of those, samples on the plane, 0..1
  double median_inverse_depth = 0.0;                // of the samples that have one [1/m]
  std::array<float, kLiftColumns> column_share{};   // inliers per column along the segment, 0..1

  /// Inverse depth on the segment itself.
  double InverseDepthAt(double u) const { return plane[0] + plane[1] * (u - 0.5); }
  bool IsSurface() const { return inlier_share > 0.55 && valid_share > 0.4; }
};

/// @param sign       +1: the side of the normal (-dy, dx), -1: the other.
/// @param rectifier  As of LiftSegments().
LiftSide FitLiftSide(const DepthView& depth, const Segment2& segment_px, int sign,
                     const LiftOptions& options, const Rectifier* rectifier = nullptr);

}  // namespace plumb
