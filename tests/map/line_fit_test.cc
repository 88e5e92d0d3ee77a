// Fit of one line over its views.
#include "plumb/map/line_fit.h"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/depth_view.h"

namespace plumb {
namespace {

const Segment3 kTruth{{-0.3, 0.1, 2.0}, {0.5, -0.2, 2.4}};
constexpr Camera kCamera{500.0, 480.0, 320.0, 240.0, 640, 480};

struct Views {
  std::vector<LineView> views;
  std::vector<LineObservation> observations;
};

Rigid3 PoseOf(int k) {
  return {ExpSo3({0.02 * k, -0.05 * k, 0.03 * k}), {0.15 * k, 0.1 * (k % 3), 0.05 * k}};
}

// Every view sees another part of the line; pixels and depths get noise of the model's size.
Views Simulate(int count, const Camera& camera, double noise, std::mt19937* random) {
  std::normal_distribution<double> normal;
  Views out;
  out.views.reserve(count);
  for (int k = 0; k < count; ++k) {
    const Rigid3 cam_from_world = PoseOf(k);
    out.views.push_back(
        {cam_from_world.RotationMatrix(), cam_from_world.translation, {camera.fx, camera.fy}});
    LineObservation observation;
    observation.view = &out.views.back();
    const double parts[2] = {0.05 * (k % 4), 1.0 - 0.07 * (k % 3)};
    Eigen::Vector2d* normalized[2] = {&observation.start_normalized, &observation.end_normalized};
    Eigen::Vector3d* lifted[2] = {&observation.lifted_in_world.start,
                                  &observation.lifted_in_world.end};
    const double mid_depth = (cam_from_world * kTruth.Midpoint()).z();
    observation.depth_sigma_m = DepthNoise().SigmaAt(mid_depth);
    for (int e = 0; e < 2; ++e) {
      const Eigen::Vector3d point = kTruth.start + parts[e] * kTruth.Delta();
      const Eigen::Vector3d in_cam = cam_from_world * point;
      const Eigen::Vector2d px =
          camera.Project(in_cam) + 0.7 * noise * Eigen::Vector2d(normal(*random), normal(*random));
      *normalized[e] = camera.Normalize(px);
      const Eigen::Vector3d error(normal(*random), normal(*random), normal(*random));
      *lifted[e] = point + noise * observation.depth_sigma_m * error;
    }
    out.observations.push_back(observation);
  }
  return out;
}

Views Exact(int count) {
  std::mt19937 random(1);
  return Simulate(count, kCamera, 0.0, &random);
}

double DistanceFromLine(const Segment3& line, const Eigen::Vector3d& x) {
  return line.Delta().normalized().cross(x - line.start).norm();
}

TEST(LineFit, JacobianEqualsDifferences) {
  std::mt19937 random(3);
  for (const Camera& camera : {kCamera, Camera{500.0, -480.0, 320.0, 240.0, 640, 480}}) {
    const Views views = Simulate(5, camera, 1.0, &random);
    const auto line = AnchoredLine::Create({kTruth.start + Eigen::Vector3d(0.01, 0.02, -0.01),
                                            kTruth.end + Eigen::Vector3d(-0.02, 0.01, 0.01)});
    ASSERT_TRUE(line);
    for (const LineObservation& observation : views.observations) {
      const LineResiduals at = EvaluateLine(*line, observation, 0.7);
      for (int k = 0; k < 4; ++k) {
        constexpr double kStep = 1e-6;
        const Vector4d delta = kStep * Vector4d::Unit(k);
        const auto plus = EvaluateLine(line->Moved(delta), observation, 0.7).value;
        const auto minus = EvaluateLine(line->Moved(-delta), observation, 0.7).value;
        const Eigen::Matrix<double, 6, 1> numeric = (plus - minus) / (2.0 * kStep);
        EXPECT_LT((at.jacobian.col(k) - numeric).norm(), 1e-5 * (1.0 + numeric.norm()));
      }
    }
  }
}

TEST(LineFit, PixelResidualIsADistanceInPixels) {
  const Views views = Exact(1);
  const auto line = AnchoredLine::Create(kTruth);
  ASSERT_TRUE(line);
  LineObservation moved = views.observations[0];
  // Across the image of the line, by 3 px.
  const Eigen::Vector2d a = kCamera.Project(PoseOf(0) * kTruth.start);
  const Eigen::Vector2d b = kCamera.Project(PoseOf(0) * kTruth.end);
  const Eigen::Vector2d normal = Eigen::Vector2d(a.y() - b.y(), b.x() - a.x()).normalized();
  moved.start_normalized = kCamera.Normalize(a + 3.0 * normal);
  moved.end_normalized = kCamera.Normalize(b - 3.0 * normal);
  const LineResiduals residuals = EvaluateLine(*line, moved, 1.0);
  EXPECT_NEAR(std::abs(residuals.value[0]), 3.0, 1e-9);
  EXPECT_NEAR(residuals.value[1], -residuals.value[0], 1e-9);
}

TEST(LineFit, ExactObservationsGiveTheLineBack) {
  const Views views = Exact(4);
  const Segment3 initial{kTruth.start + Eigen::Vector3d(0.02, -0.015, 0.03),
                         kTruth.end + Eigen::Vector3d(-0.01, 0.02, -0.03)};
  const auto fitted = FitLine(initial, views.observations);
  ASSERT_TRUE(fitted);
  EXPECT_LT(DistanceFromLine(kTruth, fitted->line.anchors_in_world.start), 1e-6);
  EXPECT_LT(DistanceFromLine(kTruth, fitted->line.anchors_in_world.end), 1e-6);
}

TEST(LineFit, OneViewIsEnoughBecauseItHasDepth) {
  const Views views = Exact(1);
  const auto fitted = FitLine(views.observations[0].lifted_in_world, views.observations);
  ASSERT_TRUE(fitted);
  EXPECT_LT(DistanceFromLine(kTruth, fitted->line.anchors_in_world.end), 1e-9);
}

TEST(LineFit, AWrongObservationHardlyMoves) {
  Views views = Exact(8);
  views.observations[3].lifted_in_world.start += Eigen::Vector3d(0.0, 0.3, 0.2);
  views.observations[3].start_normalized += Eigen::Vector2d(0.0, 0.1);
  const auto fitted = FitLine(kTruth, views.observations);
  ASSERT_TRUE(fitted);
  EXPECT_LT(DistanceFromLine(kTruth, fitted->line.anchors_in_world.start), 2e-3);
  EXPECT_LT(DistanceFromLine(kTruth, fitted->line.anchors_in_world.end), 2e-3);
}

TEST(LineFit, MoreViewsGiveSmallerCovariance) {
  const auto few = FitLine(kTruth, Exact(2).observations);
  const Views many_views = Exact(8);
  const auto many = FitLine(kTruth, many_views.observations);
  ASSERT_TRUE(few);
  ASSERT_TRUE(many);
  EXPECT_LT(many->CovarianceOfStart().trace(), few->CovarianceOfStart().trace());
}

// Of anchors free in the plane across the line, against the true line: 4 degrees of freedom.
TEST(LineFit, SquaredErrorAgreesWithTheCovariance) {
  std::mt19937 random(11);
  constexpr int kTrials = 400;
  double sum = 0.0, sum_start = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Views views = Simulate(5, kCamera, 1.0, &random);
    const auto fitted = FitLine(views.observations[0].lifted_in_world, views.observations);
    ASSERT_TRUE(fitted);
    const Segment3& anchors = fitted->line.anchors_in_world;
    const auto offset = [&](const Eigen::Vector3d& anchor) {
      const Eigen::Vector3d direction = kTruth.Delta().normalized();
      const Eigen::Vector3d error =
          (anchor - kTruth.start) - direction.dot(anchor - kTruth.start) * direction;
      return Eigen::Vector2d(fitted->line.across * error);
    };
    Vector4d error;
    error << offset(anchors.start), offset(anchors.end);
    sum += error.dot(fitted->covariance.inverse() * error);
    sum_start +=
        error.head<2>().dot(fitted->covariance.topLeftCorner<2, 2>().inverse() * error.head<2>());
  }
  // The robust weights discount good observations a little, so the covariance is cautious.
  EXPECT_GT(sum / kTrials, 4.0 * 0.65);
  EXPECT_LT(sum / kTrials, 4.0 * 1.15);
  EXPECT_GT(sum_start / kTrials, 2.0 * 0.65);
  EXPECT_LT(sum_start / kTrials, 2.0 * 1.15);
}

TEST(LineFit, CovarianceIsFreeAcrossTheLineOnly) {
  const Views views = Exact(3);
  const auto fitted = FitLine(kTruth, views.observations);
  ASSERT_TRUE(fitted);
  const Eigen::Vector3d direction = fitted->line.anchors_in_world.Delta().normalized();
  for (const Eigen::Matrix3d& covariance :
       {fitted->CovarianceOfStart(), fitted->CovarianceOfEnd()}) {
    EXPECT_LT((covariance * direction).norm(), 1e-6 * covariance.norm());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
    EXPECT_GT(eigen.eigenvalues()[1], 0.0);
  }
}

TEST(LineFit, MovingTheAnchorsAlongTheLineCarriesTheCovarianceAlong) {
  const Views views = Exact(4);
  const auto fitted = FitLine(kTruth, views.observations);
  ASSERT_TRUE(fitted);
  const FittedLine moved = fitted->WithAnchors(0.25, 1.5);
  const auto refitted = FitLine(moved.line.anchors_in_world, views.observations);
  ASSERT_TRUE(refitted);
  EXPECT_LT((moved.CovarianceOfStart() - refitted->CovarianceOfStart()).norm(),
            1e-3 * refitted->CovarianceOfStart().norm());
  EXPECT_LT((moved.CovarianceOfEnd() - refitted->CovarianceOfEnd()).norm(),
            1e-3 * refitted->CovarianceOfEnd().norm());
  EXPECT_GT(moved.CovarianceOfEnd().trace(), fitted->CovarianceOfEnd().trace());
}

TEST(LineFit, DegenerateLinesAreRefused) {
  const Views views = Exact(2);
  EXPECT_FALSE(FitLine({kTruth.start, kTruth.start}, views.observations));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(FitLine({kTruth.start, {nan, 0.0, 0.0}}, views.observations));
  EXPECT_FALSE(AnchoredLine::Create({kTruth.end, kTruth.end}));
}

TEST(LineFit, ExtentIsAQuantileOfTheObservations) {
  // Lower ends 0.0 0.1 .. 0.5, upper ends 1.0 0.9 .. 0.5 of a line along x.
  std::vector<LineObservation> observations(6);
  for (int k = 0; k < 6; ++k) {
    observations[k].lifted_in_world = {{1.0 - 0.1 * k, 0.0, 0.0}, {0.1 * k, 0.3, 0.0}};
  }
  const auto [begin, end] = SupportedExtent({{0, 0, 0}, {2, 0, 0}}, observations);
  EXPECT_NEAR(begin, 0.05, 1e-12);  // 20 % quantile 0.1 m of 2 m
  EXPECT_NEAR(end, 0.45, 1e-12);    // 80 % quantile 0.9 m
}

TEST(LineFit, ExtentOfPointsKeepsTheLine) {
  std::vector<LineObservation> observations(3);
  for (LineObservation& observation : observations) {
    observation.lifted_in_world = {{0.5, 0.0, 0.0}, {0.505, 0.0, 0.0}};
  }
  EXPECT_EQ(SupportedExtent({{0, 0, 0}, {2, 0, 0}}, observations), std::pair(0.0, 1.0));
}

}  // namespace
}  // namespace plumb
