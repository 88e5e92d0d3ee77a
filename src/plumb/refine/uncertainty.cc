#include "plumb/refine/uncertainty.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace plumb {
namespace {

constexpr double kMinResidualScale = 0.02;

}  // namespace

Observability Observe(const Matrix6d& information, const Matrix6d& prior_information) {
  Observability out;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix6d> solver(information, prior_information,
                                                                  Eigen::EigenvaluesOnly);
  if (solver.info() != Eigen::Success) return out;
  out.gain = solver.eigenvalues();
  for (int i = 0; i < 6; ++i) out.num_observed += out.gain[i] > 1.0 ? 1 : 0;
  return out;
}

Matrix6d PoseCovariance(const Matrix6d& information, double residual_scale, double map_factor,
                        const Matrix6d& prior_information) {
  const double factor = std::max(residual_scale, kMinResidualScale) * map_factor;
  const Matrix6d total = information / factor + prior_information;
  const Matrix6d covariance = total.llt().solve(Matrix6d::Identity());
  return 0.5 * (covariance + covariance.transpose());
}

Matrix6d PriorCovariance(double rotation_sigma_rad, double position_sigma_m) {
  Vector6d diagonal;
  diagonal << Eigen::Vector3d::Constant(rotation_sigma_rad * rotation_sigma_rad / 3.0),
      Eigen::Vector3d::Constant(position_sigma_m * position_sigma_m / 3.0);
  return diagonal.asDiagonal();
}

}  // namespace plumb
