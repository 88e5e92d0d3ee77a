#include "plumb/runtime/gravity.h"

#include <cmath>

#include "plumb/refine/uncertainty.h"

namespace plumb {
namespace {

constexpr double kMaxDeviations = 5.0;

}  // namespace

PosePrior FuseGravity(const PosePrior& prior) {
  if (!prior.gravity) return prior;
  PosePrior fused = prior;
  const Eigen::Vector3d down_in_world = prior.gravity->down_in_world.normalized();
  const Eigen::Vector3d measured = prior.gravity->down_in_camera.normalized();
  const Rigid3& pose = prior.cam_from_world;
  const Eigen::Vector3d predicted = pose.rotation * down_in_world;
  const double prior_variance = prior.rotation_sigma_rad * prior.rotation_sigma_rad / 3.0;
  const double variance = prior.gravity->sigma_rad * prior.gravity->sigma_rad;
  const double angle = std::atan2(predicted.cross(measured).norm(), predicted.dot(measured));
  if (angle * angle > kMaxDeviations * kMaxDeviations * (prior_variance + variance)) {
    fused.gravity.reset();
    return fused;
  }
  const double share = prior_variance / (prior_variance + variance);
  const Eigen::Vector3d axis = predicted.cross(measured);
  if (axis.norm() > 0.0) {
    const Eigen::Quaterniond turn = ExpSo3(share * angle * axis.normalized());
    const Eigen::Quaterniond rotation = (turn * pose.rotation).normalized();
    fused.cam_from_world = {rotation, -(rotation * pose.Center())};
  }
  fused.gravity = GravityPrior{.down_in_camera = fused.cam_from_world.rotation * down_in_world,
                               .down_in_world = down_in_world,
                               .sigma_rad = std::sqrt(share * variance)};
  return fused;
}

Matrix6d CovarianceOf(const PosePrior& fused) {
  Matrix6d covariance = PriorCovariance(fused.rotation_sigma_rad, fused.position_sigma_m);
  if (fused.gravity) {
    const double tilt = fused.gravity->sigma_rad * fused.gravity->sigma_rad;
    const Eigen::Vector3d& down = fused.gravity->down_in_camera;
    const Eigen::Matrix3d about = down * down.transpose();
    covariance.topLeftCorner<3, 3>() =
        tilt * (Eigen::Matrix3d::Identity() - about) + covariance(0, 0) * about;
  }
  return covariance;
}

}  // namespace plumb
