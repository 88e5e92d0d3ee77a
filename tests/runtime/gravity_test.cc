#include "plumb/runtime/gravity.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace plumb {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
const Eigen::Vector3d kDown(0.0, 0.0, -2.0);

Rigid3 Truth() { return {ExpSo3({0.3, -0.8, 0.4}), {0.5, -1.0, 2.0}}; }

PosePrior Prior(const Eigen::Vector3d& error_in_camera) {
  const Eigen::Quaterniond rotation = (ExpSo3(error_in_camera) * Truth().rotation).normalized();
  return {{rotation, -(rotation * Truth().Center())}, 0.1, 8.0 * kDegree};
}

GravityPrior Gravity(double sigma_rad) {
  return {3.0 * (Truth().rotation * kDown), kDown, sigma_rad};
}

double TiltError(const Rigid3& pose) {
  const Eigen::Vector3d down = kDown.normalized();
  return std::acos(std::min(1.0, (pose.rotation * down).dot(Truth().rotation * down)));
}

TEST(FuseGravity, ExactGravityRightsTheTiltAndKeepsTurnAndCentre) {
  PosePrior prior = Prior({0.10, 0.02, -0.08});
  prior.gravity = Gravity(1e-6);
  ASSERT_GT(TiltError(prior.cam_from_world), 2.0 * kDegree);
  const PosePrior fused = FuseGravity(prior);
  EXPECT_LT(TiltError(fused.cam_from_world), 1e-6);
  EXPECT_LT((fused.cam_from_world.Center() - Truth().Center()).norm(), 1e-9);
  // The smallest rotation that does it: no turn about the direction down.
  const Eigen::AngleAxisd turn(fused.cam_from_world.rotation *
                               prior.cam_from_world.rotation.conjugate());
  EXPECT_NEAR(turn.axis().dot(fused.gravity->down_in_camera), 0.0, 1e-6);
  EXPECT_NEAR(fused.gravity->sigma_rad, 1e-6, 1e-9);
  EXPECT_NEAR(fused.gravity->down_in_camera.norm(), 1.0, 1e-12);
}

TEST(FuseGravity, EqualVariancesMeetHalfWay) {
  PosePrior prior = Prior({0.05, 0.0, 0.05});
  prior.gravity = Gravity(8.0 * kDegree / std::sqrt(3.0));
  const PosePrior fused = FuseGravity(prior);
  EXPECT_NEAR(TiltError(fused.cam_from_world), 0.5 * TiltError(prior.cam_from_world), 1e-9);
  EXPECT_NEAR(fused.gravity->sigma_rad, prior.gravity->sigma_rad / std::sqrt(2.0), 1e-12);
}

TEST(FuseGravity, OneThatContradictsIsDropped) {
  PosePrior prior = Prior({0.05, 0.0, 0.05});
  prior.gravity = Gravity(0.5 * kDegree);
  prior.gravity->down_in_camera *= -1.0;  // up instead of down
  const PosePrior fused = FuseGravity(prior);
  EXPECT_FALSE(fused.gravity);
  EXPECT_EQ(fused.cam_from_world.rotation.coeffs(), prior.cam_from_world.rotation.coeffs());
}

TEST(FuseGravity, CovarianceIsTightAcrossGravityOnly) {
  PosePrior prior = Prior({0.0, 0.0, 0.0});
  const Matrix6d loose = CovarianceOf(FuseGravity(prior));
  prior.gravity = Gravity(0.5 * kDegree);
  const PosePrior fused = FuseGravity(prior);
  const Matrix6d covariance = CovarianceOf(fused);
  const Eigen::Vector3d down = fused.gravity->down_in_camera;
  const Eigen::Vector3d across = down.unitOrthogonal();
  const Eigen::Matrix3d rotation = covariance.topLeftCorner<3, 3>();
  EXPECT_NEAR(down.dot(rotation * down), loose(0, 0), 1e-12);
  EXPECT_NEAR(across.dot(rotation * across), std::pow(fused.gravity->sigma_rad, 2), 1e-12);
  EXPECT_LT(fused.gravity->sigma_rad, 0.5 * kDegree);
  EXPECT_EQ((covariance.bottomRightCorner<3, 3>()), (loose.bottomRightCorner<3, 3>()));
}

}  // namespace
}  // namespace plumb
