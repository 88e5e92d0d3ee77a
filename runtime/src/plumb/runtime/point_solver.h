// Pose from 2D-3D points alone, for frames whose lines do not decide.
#pragma once

#include <cstddef>
#include <span>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/refine/normal_equations.h"

namespace plumb {

struct PointPose {
  Rigid3 cam_from_world;
  size_t num_inliers = 0;  // points that ReprojectsNear() the pose
};

/// Whether the point's image is within 10 px of its pixel.
bool ReprojectsNear(const Camera& camera, const Rigid3& cam_from_world,
                    const PointObservation& point);

/// Robust Gauss-Newton from the prior. The robust scale is the points' own median, so that it
/// shrinks with the error; up to half of the points may be wrong. Owns its work space; not
/// thread-safe.
class PointSolver {
 public:
  PointPose Solve(const Camera& camera, const PosePriorFactor& prior,
                  std::span<const PointObservation> points);

 private:
  PointAccumulator accumulator_;
};

}  // namespace plumb
