// Pose from 2D-3D points alone, for frames whose lines do not decide.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/refine/normal_equations.h"
#include "plumb/refine/point_terms.h"

namespace plumb {

struct PointPose {
  Rigid3 cam_from_world;
  size_t num_inliers = 0;  // points within kNearPointPx
};

/// Points whose image is farther from their pixel do not hold a pose.
inline constexpr double kNearPointPx = 10.0;

/// Robust Gauss-Newton from the prior. The robust scale is the points' own median, so that it
/// shrinks with the error; up to half of the points may be wrong. Owns its work space; not
/// thread-safe.
class PointSolver {
 public:
  PointPose Solve(const Camera& camera, const PosePriorFactor& prior, const PointTable& points);

 private:
  PointTableAccumulator accumulator_;
  std::vector<uint32_t> near_;
};

}  // namespace plumb
