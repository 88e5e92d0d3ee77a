// What a refined pose is worth: covariance and the directions that the matches determine.
#pragma once

#include <Eigen/Core>

#include "plumb/geometry/rigid3.h"

namespace plumb {

/// Information of the matches against that of the prior, direction by direction.
struct Observability {
  int num_observed = 0;  // of 6: directions that the matches determine better than the prior
  /// Generalised eigenvalues of (matches, prior), ascending: information gained over the prior's.
  Vector6d gain = Vector6d::Zero();
};

/// @param information        J^T W J of the matches alone, positive semi-definite, finite.
/// @param prior_information  Positive definite.
/// A solver that reports convergence says nothing about this: a zero Jacobian converges at once.
Observability Observe(const Matrix6d& information, const Matrix6d& prior_information);

/// (information / (residual_scale * map_factor) + prior_information)^-1.
/// @param residual_scale  Of this frame (LineEquations), taken as at least 0.02.
/// @param map_factor      Calibrated on left-out key frames of the map, > 0.
Matrix6d PoseCovariance(const Matrix6d& information, double residual_scale, double map_factor,
                        const Matrix6d& prior_information);

/// Covariance of a pose that is only known as well as its prior, whose camera centre and rotation
/// errors are independent. The sigmas are norms of whole vectors: a third of the variance each.
Matrix6d PriorCovariance(double rotation_sigma_rad, double position_sigma_m);

}  // namespace plumb
