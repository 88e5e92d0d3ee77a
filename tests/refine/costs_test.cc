#include <cmath>
#include <functional>
#include <memory>

#include <ceres/cost_function.h>

#include <gtest/gtest.h>

#include "plumb/geometry/rigid3.h"
#include "plumb/refine/cost/line_angle.h"
#include "plumb/refine/cost/midpoint_distance.h"
#include "plumb/refine/cost/overlap_distance.h"
#include "plumb/refine/cost/point_reprojection.h"
#include "plumb/refine/cost/pose_prior.h"

namespace plumb {
namespace {

const Camera kCamera{525.0, -480.0, 319.5, 239.5, 640, 480};
const Segment3 kLine{{-0.4, 0.3, 2.5}, {0.7, -0.2, 3.4}};
const Segment2 kSegment{{200.0, 150.0}, {420.0, 310.0}};

Rigid3 Pose() { return {ExpSo3({0.1, -0.2, 0.05}), {0.05, -0.1, 0.2}}; }

std::vector<double> Evaluate(const ceres::CostFunction& cost, const Rigid3& pose) {
  const double* blocks[] = {pose.rotation.coeffs().data(), pose.translation.data()};
  std::vector<double> residuals(cost.num_residuals());
  EXPECT_TRUE(cost.Evaluate(blocks, residuals.data(), nullptr));
  return residuals;
}

bool CanEvaluate(const ceres::CostFunction& cost, const Rigid3& pose) {
  const double* blocks[] = {pose.rotation.coeffs().data(), pose.translation.data()};
  double residuals[6];
  return cost.Evaluate(blocks, residuals, nullptr);
}

/// Autodiff Jacobians against central differences in the seven ambient parameters.
void ExpectJacobiansMatch(ceres::CostFunction* raw) {
  const std::unique_ptr<ceres::CostFunction> cost(raw);
  const Rigid3 pose = Pose();
  const int rows = cost->num_residuals();
  std::vector<double> residuals(rows), by_q(rows * 4), by_t(rows * 3);
  const double* blocks[] = {pose.rotation.coeffs().data(), pose.translation.data()};
  double* jacobians[] = {by_q.data(), by_t.data()};
  ASSERT_TRUE(cost->Evaluate(blocks, residuals.data(), jacobians));
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 7; ++k) {
    Rigid3 plus = pose, minus = pose;
    (k < 4 ? plus.rotation.coeffs()[k] : plus.translation[k - 4]) += kStep;
    (k < 4 ? minus.rotation.coeffs()[k] : minus.translation[k - 4]) -= kStep;
    const auto high = Evaluate(*cost, plus), low = Evaluate(*cost, minus);
    for (int r = 0; r < rows; ++r) {
      const double numeric = (high[r] - low[r]) / (2 * kStep);
      const double analytic = k < 4 ? by_q[r * 4 + k] : by_t[r * 3 + k - 4];
      EXPECT_NEAR(analytic, numeric, 1e-5 * (1.0 + std::abs(numeric)))
          << "residual " << r << " parameter " << k;
    }
  }
}

TEST(OverlapDistanceCost, JacobianMatchesNumericDifferences) {
  ExpectJacobiansMatch(OverlapDistanceCost::Create(kCamera, kLine, kSegment, 1.4));
}

TEST(MidpointDistanceCost, JacobianMatchesNumericDifferences) {
  ExpectJacobiansMatch(MidpointDistanceCost::Create(kCamera, kLine, kSegment, 0.8));
}

TEST(LineAngleCost, JacobianMatchesNumericDifferences) {
  ExpectJacobiansMatch(LineAngleCost::Create(kCamera, kLine, kSegment, 130.0));
}

TEST(PointReprojectionCost, JacobianMatchesNumericDifferences) {
  Eigen::Matrix2d covariance;
  covariance << 2.0, 0.6, 0.6, 1.1;
  ExpectJacobiansMatch(PointReprojectionCost::Create(
      kCamera, {0.2, 0.1, 2.0}, {300, 200}, PointReprojectionCost::FromCovariance(covariance)));
}

TEST(PosePriorCost, JacobianMatchesNumericDifferences) {
  ExpectJacobiansMatch(
      PosePriorCost::Create({ExpSo3({0.02, 0.1, -0.03}), {0, 0.1, 0.1}}, 0.03, 0.1));
}

TEST(OverlapDistanceCost, SlidingAlongTheLineChangesNothing) {
  // The residual of a fragment must not depend on which part of the line it shows.
  const Rigid3 pose = Pose();
  const Eigen::Vector2d a = kCamera.Project(pose * kLine.start);
  const Eigen::Vector2d b = kCamera.Project(pose * kLine.end);
  for (const double from : {0.0, 0.3, 0.8}) {
    const Segment2 part{a + from * (b - a), a + (from + 0.2) * (b - a)};
    const std::unique_ptr<ceres::CostFunction> cost(
        OverlapDistanceCost::Create(kCamera, kLine, part, 1.0));
    for (const double r : Evaluate(*cost, pose)) EXPECT_NEAR(r, 0.0, 1e-9);
  }
}

TEST(MidpointDistanceCost, FragmentsPullAlongTheLine) {
  // What the paper's equation 6 does, and the reason for the residual above.
  const Rigid3 pose = Pose();
  const Eigen::Vector2d a = kCamera.Project(pose * kLine.start);
  const Eigen::Vector2d b = kCamera.Project(pose * kLine.end);
  const std::unique_ptr<ceres::CostFunction> cost(
      MidpointDistanceCost::Create(kCamera, kLine, {a, 0.5 * (a + b)}, 1.0));
  const auto r = Evaluate(*cost, pose);
  EXPECT_NEAR(std::hypot(r[0], r[1]), 0.25 * (b - a).norm(), 1e-6);
}

TEST(LineAngleCost, IsScaleTimesSine) {
  const Rigid3 pose = Pose();
  const Eigen::Vector2d a = kCamera.Project(pose * kLine.start);
  const Eigen::Vector2d d = (kCamera.Project(pose * kLine.end) - a).normalized();
  const double angle = 0.1;
  const Eigen::Vector2d turned = Eigen::Rotation2Dd(angle) * d;
  const std::unique_ptr<ceres::CostFunction> cost(
      LineAngleCost::Create(kCamera, kLine, {a, a + 50 * turned}, 200.0));
  EXPECT_NEAR(std::abs(Evaluate(*cost, pose)[0]), 200.0 * std::sin(angle), 1e-6);
}

TEST(Costs, LinesAndPointsWithoutImageAreRefused) {
  const Rigid3 origin;
  const Segment3 through_centre{{0, 0, 1}, {0, 0, 2}}, behind{{0, 0, -1}, {1, 0, -2}};
  const std::unique_ptr<ceres::CostFunction> overlap(
      OverlapDistanceCost::Create(kCamera, through_centre, kSegment, 1.0));
  const std::unique_ptr<ceres::CostFunction> angle(
      LineAngleCost::Create(kCamera, through_centre, kSegment, 1.0));
  const std::unique_ptr<ceres::CostFunction> middle(
      MidpointDistanceCost::Create(kCamera, behind, kSegment, 1.0));
  const std::unique_ptr<ceres::CostFunction> point(PointReprojectionCost::Create(
      kCamera, {0, 0, 0.05}, {300, 200}, Eigen::Matrix2d::Identity()));
  EXPECT_FALSE(CanEvaluate(*overlap, origin));
  EXPECT_FALSE(CanEvaluate(*angle, origin));
  EXPECT_FALSE(CanEvaluate(*middle, origin));
  EXPECT_FALSE(CanEvaluate(*point, origin));
}

TEST(PosePriorCost, IsTheWhitenedDifference) {
  const Rigid3 prior{ExpSo3({0.3, 0.1, -0.2}), {1, 2, 3}};
  const Vector6d delta = (Vector6d() << 0.02, -0.01, 0.03, 0.1, 0.2, -0.1).finished();
  const std::unique_ptr<ceres::CostFunction> cost(PosePriorCost::Create(prior, 0.05, 0.2));
  const auto r = Evaluate(*cost, Perturb(prior, delta));
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(r[i], delta[i] / (i < 3 ? 0.05 : 0.2), 1e-9);
  for (const double zero : Evaluate(*cost, prior)) EXPECT_NEAR(zero, 0.0, 1e-12);
}

TEST(PointReprojectionCost, WhiteningMakesTheSquareAMahalanobisDistance) {
  Eigen::Matrix2d covariance;
  covariance << 3.0, -0.9, -0.9, 1.5;
  const Rigid3 pose = Pose();
  const Eigen::Vector3d x(0.2, 0.1, 2.0);
  const Eigen::Vector2d pixel(300, 200);
  const std::unique_ptr<ceres::CostFunction> cost(PointReprojectionCost::Create(
      kCamera, x, pixel, PointReprojectionCost::FromCovariance(covariance)));
  const auto r = Evaluate(*cost, pose);
  const Eigen::Vector2d e = kCamera.Project(pose * x) - pixel;
  EXPECT_NEAR(r[0] * r[0] + r[1] * r[1], e.dot(covariance.inverse() * e), 1e-6);
}

}  // namespace
}  // namespace plumb
