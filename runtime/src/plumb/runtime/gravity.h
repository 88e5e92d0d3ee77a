// What an inertial sensor's gravity adds to a coarse pose.
#pragma once

#include <Eigen/Core>

#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// The prior, turned about its camera centre to where its tilt and gravity agree best by their
/// variances; `gravity` then holds the unit direction down at that pose, in the camera and in the
/// world, and what remains of the tilt's uncertainty. A gravity that contradicts the prior's tilt
/// by more than 5 deviations is dropped: one of both is broken, and only the prior is needed.
PosePrior FuseGravity(const PosePrior& prior);

/// PriorCovariance(), with the tilt as certain as a fused gravity makes it.
Matrix6d CovarianceOf(const PosePrior& fused);

}  // namespace plumb
