// Whether covariances are honest: squared errors in units of what the covariances promise.
#pragma once

#include <cstddef>
#include <span>

#include "plumb/geometry/rigid3.h"

namespace plumb::tools {

/// A refined pose with its covariance, and the true one.
struct PoseWithCovariance {
  Rigid3 true_cam_from_world;
  Rigid3 refined_cam_from_world;
  Matrix6d covariance;  // of the left perturbation (rotation [rad], translation [m]) of the refined
};

/// Squared errors e^T C^-1 e over their expectation: 1 where the covariance is right, 4 where
/// errors are twice as large as promised.
struct NormalisedError {
  double median = 0.0;  // over the median of the chi-square distribution
  double mean = 0.0;    // over the number of degrees of freedom
};

struct NormalisedErrors {
  size_t num_frames = 0;
  NormalisedError pose;                // 6 degrees of freedom
  NormalisedError rotation, position;  // 3 each; position of the camera centre
};

/// Frames whose covariance is not positive definite are left out. All zero without frames.
NormalisedErrors EvaluateCovariances(std::span<const PoseWithCovariance> frames);

}  // namespace plumb::tools
