#include "plumb/geometry/rigid3.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace plumb {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::Vector3d RandomVector(std::mt19937* rng, double scale) {
  std::normal_distribution<double> normal(0.0, scale);
  return {normal(*rng), normal(*rng), normal(*rng)};
}

Rigid3 RandomPose(std::mt19937* rng) {
  return {ExpSo3(RandomVector(rng, 1.0)), RandomVector(rng, 2.0)};
}

TEST(Hat, IsTheCrossProduct) {
  const Eigen::Vector3d w(1.0, -2.0, 3.0), x(0.5, 4.0, -1.0);
  EXPECT_EQ(Hat(w) * x, w.cross(x));
  EXPECT_EQ(Hat(w).transpose(), -Hat(w));
}

TEST(ExpSo3, TurnsAboutTheVectorByItsLength) {
  const Eigen::Quaterniond quarter = ExpSo3({0.0, 0.0, 0.5 * kPi});
  EXPECT_TRUE((quarter * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitY(), 1e-15));
}

TEST(ExpSo3, IsTheIdentityAtZero) {
  EXPECT_EQ(ExpSo3(Eigen::Vector3d::Zero()).coeffs(), Eigen::Quaterniond::Identity().coeffs());
}

TEST(ExpSo3, IsSmoothWhereTheSeriesTakesOver) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1.0, 2.0, -2.0) / 3.0;
  for (const double angle : {0.99e-4, 1.01e-4}) {
    const Eigen::Quaterniond q = ExpSo3(angle * axis);
    EXPECT_NEAR(q.vec().norm() / std::sin(0.5 * angle), 1.0, 1e-14) << angle;
  }
}

TEST(LogSo3, InvertsExpUpToHalfATurn) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> angle(0.0, kPi - 1e-6);
  for (int trial = 0; trial < 1000; ++trial) {
    const Eigen::Vector3d w = angle(rng) * RandomVector(&rng, 1.0).normalized();
    EXPECT_LT((LogSo3(ExpSo3(w)) - w).norm(), 1e-9);
  }
}

TEST(LogSo3, KeepsTinyRotations) {
  for (const double angle : {1e-4, 1e-8, 1e-10, 1e-15}) {
    const Eigen::Vector3d w = angle * Eigen::Vector3d(2.0, -1.0, 2.0) / 3.0;
    EXPECT_LT((LogSo3(ExpSo3(w)) - w).norm(), 1e-9 * angle) << angle;
  }
}

TEST(LogSo3, IsAtMostHalfATurn) {
  // 1.5 turns one way are half a turn the other way.
  EXPECT_TRUE(
      LogSo3(ExpSo3({0.0, 1.5 * kPi, 0.0})).isApprox(Eigen::Vector3d(0, -0.5 * kPi, 0), 1e-12));
  EXPECT_NEAR(LogSo3(ExpSo3({kPi, 0.0, 0.0})).norm(), kPi, 1e-12);
}

TEST(LogSo3, IsTheSameForBothQuaternionsOfARotation) {
  std::mt19937 rng(2);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Quaterniond q = ExpSo3(RandomVector(&rng, 1.0));
    const Eigen::Quaterniond negative(-q.coeffs());
    EXPECT_TRUE(LogSo3(q).isApprox(LogSo3(negative), 1e-12));
  }
}

TEST(Rigid3, ComposesFromTheInsideOut) {
  std::mt19937 rng(3);
  const Rigid3 c_from_b = RandomPose(&rng), b_from_a = RandomPose(&rng);
  const Eigen::Vector3d x_in_a = RandomVector(&rng, 3.0);
  EXPECT_TRUE(((c_from_b * b_from_a) * x_in_a).isApprox(c_from_b * (b_from_a * x_in_a), 1e-12));
}

TEST(Rigid3, TimesItsInverseIsTheIdentity) {
  std::mt19937 rng(4);
  for (int trial = 0; trial < 100; ++trial) {
    const Rigid3 pose = RandomPose(&rng);
    const Rigid3 identity = pose * pose.Inverse();
    EXPECT_LT(identity.translation.norm(), 1e-12);
    EXPECT_LT(LogSo3(identity.rotation).norm(), 1e-12);
  }
}

TEST(Rigid3, CentreIsWhatTheCameraHasAtItsOrigin) {
  std::mt19937 rng(5);
  const Rigid3 cam_from_world = RandomPose(&rng);
  EXPECT_LT((cam_from_world * cam_from_world.Center()).norm(), 1e-12);
  EXPECT_TRUE(cam_from_world.Center().isApprox(cam_from_world.Inverse().translation, 1e-12));
}

TEST(Rigid3, StaysARotationOverManyProducts) {
  std::mt19937 rng(6);
  const Rigid3 step = {ExpSo3(RandomVector(&rng, 0.1)), Eigen::Vector3d::Zero()};
  Rigid3 pose;
  for (int i = 0; i < 100'000; ++i) pose = pose * step;
  EXPECT_NEAR(pose.rotation.norm(), 1.0, 1e-14);
}

TEST(Rigid3, IsFiniteOnlyIfEveryNumberIs) {
  Rigid3 pose;
  EXPECT_TRUE(pose.IsFinite());
  pose.translation.z() = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(pose.IsFinite());
  pose = {};
  pose.rotation.w() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(pose.IsFinite());
}

TEST(Perturb, ActsOnPointsInTheCamera) {
  std::mt19937 rng(7);
  const Rigid3 cam_from_world = RandomPose(&rng);
  Vector6d delta;
  delta << 0.1, -0.2, 0.3, 1.0, 2.0, -3.0;
  const Eigen::Vector3d x = RandomVector(&rng, 2.0);
  const Eigen::Vector3d expected = ExpSo3(delta.head<3>()) * (cam_from_world * x) + delta.tail<3>();
  EXPECT_TRUE((Perturb(cam_from_world, delta) * x).isApprox(expected, 1e-12));
}

TEST(Perturb, ByZeroChangesNothing) {
  std::mt19937 rng(8);
  const Rigid3 pose = RandomPose(&rng);
  const Rigid3 same = Perturb(pose, Vector6d::Zero());
  EXPECT_LT((same.rotation.coeffs() - pose.rotation.coeffs()).norm(), 1e-15);
  EXPECT_EQ(same.translation, pose.translation);
}

TEST(Difference, IsWhatPerturbNeeds) {
  std::mt19937 rng(9);
  for (int trial = 0; trial < 200; ++trial) {
    const Rigid3 from = RandomPose(&rng), to = RandomPose(&rng);
    const Rigid3 reached = Perturb(from, Difference(to, from));
    const PoseDistance error = DistanceBetween(reached, to);
    EXPECT_LT(error.position_m, 1e-9);
    EXPECT_LT(error.rotation_rad, 1e-9);
    Vector6d delta;
    delta << RandomVector(&rng, 0.3), RandomVector(&rng, 1.0);
    EXPECT_LT((Difference(Perturb(from, delta), from) - delta).norm(), 1e-9);
  }
}

TEST(DistanceBetween, MeasuresCentresNotTranslations) {
  // A camera that turns in place: the translation of cam_from_world changes, the centre does not.
  const Eigen::Vector3d center(10.0, 0.0, 0.0);
  const Eigen::Quaterniond turn = ExpSo3({0.0, 0.3, 0.0});
  const PoseDistance distance =
      DistanceBetween({Eigen::Quaterniond::Identity(), -center}, {turn, -(turn * center)});
  EXPECT_LT(distance.position_m, 1e-12);
  EXPECT_NEAR(distance.rotation_rad, 0.3, 1e-12);
}

TEST(DistanceBetween, DoesNotDependOnTheWorldFrame) {
  std::mt19937 rng(10);
  const Rigid3 a = RandomPose(&rng), b = RandomPose(&rng), world_from_other = RandomPose(&rng);
  const PoseDistance here = DistanceBetween(a, b);
  const PoseDistance there = DistanceBetween(a * world_from_other, b * world_from_other);
  const PoseDistance back = DistanceBetween(b, a);
  EXPECT_NEAR(here.position_m, there.position_m, 1e-12);
  EXPECT_NEAR(here.rotation_rad, there.rotation_rad, 1e-12);
  EXPECT_NEAR(here.position_m, back.position_m, 1e-12);
  EXPECT_NEAR(here.rotation_rad, back.rotation_rad, 1e-12);
}

}  // namespace
}  // namespace plumb
