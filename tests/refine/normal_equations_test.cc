#include "plumb/refine/normal_equations.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gtest/gtest.h>

#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

const Camera kCamera{525.0, -480.0, 319.5, 239.5, 640, 480};

Rigid3 Pose() { return {ExpSo3({0.1, -0.2, 0.05}), {0.05, -0.1, 0.2}}; }

std::vector<LineObservation> Lines(const Rigid3& pose, double offset_px) {
  std::vector<LineObservation> out;
  const Segment3 lines[] = {
      {{-0.4, 0.3, 2.5}, {0.7, -0.2, 3.4}}, {{0.5, 0.5, 2.0}, {0.6, -0.6, 2.2}},
      {{-0.8, 0.1, 3.0}, {0.4, 0.2, 2.4}},  {{0, 0.4, 4.0}, {0.9, 0.5, 3.5}},
      {{-0.5, -0.5, 2}, {-0.5, 0.6, 2.8}},  {{-0.9, -0.4, 3}, {0.3, -0.5, 3}}};
  for (const Segment3& line : lines) {
    const Eigen::Vector2d a = kCamera.Project(pose * line.start);
    const Eigen::Vector2d b = kCamera.Project(pose * line.end);
    const Eigen::Vector2d n = Eigen::Vector2d(a.y() - b.y(), b.x() - a.x()).normalized();
    out.push_back({line,
                   {a + 0.2 * (b - a) + offset_px * n, a + 0.7 * (b - a) + offset_px * n},
                   0.5 + 0.25 * static_cast<double>(out.size()),
                   0.8});
  }
  return out;
}

std::vector<PointObservation> Points(const Rigid3& pose) {
  std::vector<PointObservation> out;
  for (int i = 0; i < 20; ++i) {
    PointObservation& p = out.emplace_back();
    p.point_in_world = {0.1 * (i % 5) - 0.2, 0.15 * (i / 5) - 0.3, 2.0 + 0.1 * (i % 7)};
    p.pixel = kCamera.Project(pose * p.point_in_world);
    p.deviation_in_world = {0.002 * (i % 3), 0.0, 0.01};
  }
  return out;
}

TEST(DistanceToLine, IsTheDistanceToTheProjectedLine) {
  const Eigen::Vector3d a(-0.4, 0.3, 2.5), b(0.7, -0.2, 3.4);
  const Eigen::Vector2d point(250, 200);
  const auto distance = DistanceToLine(kCamera, a, b, point);
  const auto image = ProjectLine(kCamera, {a, b});
  ASSERT_TRUE(distance && image);
  EXPECT_NEAR(std::abs(distance->residual_px), std::abs(image->SignedDistance(point)), 1e-9);
}

TEST(DistanceToLine, JacobianMatchesNumericDifferences) {
  const Eigen::Vector3d a(-0.4, 0.3, 2.5), b(0.7, -0.2, 3.4);
  const Eigen::Vector2d point(250, 200);
  const auto at = DistanceToLine(kCamera, a, b, point);
  ASSERT_TRUE(at);
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 6; ++k) {
    const auto moved = [&](double sign) {
      const Rigid3 turn = Perturb(Rigid3{}, sign * kStep * Vector6d::Unit(k));
      return DistanceToLine(kCamera, turn * a, turn * b, point)->residual_px;
    };
    EXPECT_NEAR(at->jacobian[k], (moved(1) - moved(-1)) / (2 * kStep),
                1e-5 * (1 + std::abs(at->jacobian[k])))
        << "component " << k;
  }
}

TEST(DistanceToLine, LinesThroughTheCentreHaveNone) {
  EXPECT_FALSE(DistanceToLine(kCamera, {0, 0, 1}, {0, 0, 2}, {100, 100}));
  EXPECT_FALSE(DistanceToLine(kCamera, {1, 2, 0}, {3, -1, 0}, {100, 100}));  // focal plane
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(DistanceToLine(kCamera, {nan, 0, 1}, {1, 0, 2}, {100, 100}));
}

TEST(AccumulateLines, GradientIsTheDerivativeOfHalfTheWeightedSquares) {
  // With frozen robust weights: compare against a cost whose weights stay those of the start.
  const Rigid3 pose = Pose();
  const auto observations = Lines(Perturb(pose, 0.002 * Vector6d::Ones()), 0.3);
  constexpr double kWide = 1e6;  // so wide that the robust weight is one
  const auto cost = [&](const Rigid3& at) {
    double sum = 0.0;
    for (const LineObservation& o : observations) {
      const auto image =
          ProjectLine(kCamera, {at * o.line_in_world.start, at * o.line_in_world.end});
      for (const Eigen::Vector2d& p : {o.part_px.start, o.part_px.end}) {
        sum += 0.5 * o.weight / o.variance_px2 * std::pow(image->SignedDistance(p), 2);
      }
    }
    return sum;
  };
  const LineEquations terms = AccumulateLines(kCamera, pose, observations, kWide);
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 6; ++k) {
    const double numeric = (cost(Perturb(pose, kStep * Vector6d::Unit(k))) -
                            cost(Perturb(pose, -kStep * Vector6d::Unit(k)))) /
                           (2 * kStep);
    EXPECT_NEAR(terms.equations.gradient[k], numeric, 1e-4 * (1 + std::abs(numeric)));
  }
  EXPECT_EQ(terms.num_residuals, 12);
  EXPECT_LT((terms.equations.information - terms.equations.information.transpose()).norm(), 1e-9);
}

TEST(AccumulateLines, ResidualScaleIsOneForResidualsOfTheirSize) {
  const auto observations = Lines(Pose(), std::sqrt(0.8));
  EXPECT_NEAR(AccumulateLines(kCamera, Pose(), observations, 2.0).residual_scale, 1.0, 1e-6);
  EXPECT_EQ(AccumulateLines(kCamera, Pose(), {}, 2.0).residual_scale, 1.0);
}

TEST(AccumulateLines, FarOutliersHaveNoSay) {
  auto observations = Lines(Pose(), 0.0);
  const Matrix6d clean = AccumulateLines(kCamera, Pose(), observations, 1.0).equations.information;
  LineObservation outlier = observations[0];
  outlier.part_px.start.y() += 100;
  outlier.part_px.end.y() += 100;
  observations.push_back(outlier);
  const LineEquations with = AccumulateLines(kCamera, Pose(), observations, 1.0);
  EXPECT_LT((with.equations.information - clean).norm(), 1e-4 * clean.norm());
}

TEST(AccumulateLines, StepsLeadToThePose) {
  const auto observations = Lines(Pose(), 0.0);
  Rigid3 pose = Perturb(Pose(), (Vector6d() << 0.02, -0.01, 0.015, 0.03, 0.02, -0.04).finished());
  for (int i = 0; i < 15; ++i) {
    const auto step = SolveStep(AccumulateLines(kCamera, pose, observations, 50.0).equations, 0.1);
    ASSERT_TRUE(step);
    pose = Perturb(pose, *step);
  }
  const PoseDistance error = DistanceBetween(pose, Pose());
  EXPECT_LT(error.position_m, 1e-5);
  EXPECT_LT(error.rotation_rad, 1e-5);
}

TEST(PointAccumulator, StepsLeadToThePoseDespiteOutliers) {
  auto points = Points(Pose());
  for (int i = 0; i < 5; ++i) points[4 * i].pixel.x() += 40;
  PointAccumulator accumulator;
  Rigid3 pose = Perturb(Pose(), (Vector6d() << 0.02, -0.01, 0.015, 0.05, 0.02, -0.04).finished());
  for (int i = 0; i < 20; ++i) {
    const auto terms = accumulator.Accumulate(kCamera, pose, points);
    EXPECT_EQ(terms.num_points, 20);
    const auto step = SolveStep(terms.equations, 0.1);
    ASSERT_TRUE(step);
    pose = Perturb(pose, *step);
  }
  EXPECT_LT(DistanceBetween(pose, Pose()).position_m, 1e-3);
}

TEST(PointAccumulator, DepthDeviationMakesTheRayWeak) {
  auto exact = Points(Pose()), uncertain = exact;
  for (auto& p : exact) p.deviation_in_world.setZero();
  for (auto& p : uncertain) p.deviation_in_world = {0.05, 0, 0};
  PointAccumulator accumulator;
  const Matrix6d a = accumulator.Accumulate(kCamera, Pose(), exact).equations.information;
  const Matrix6d b = accumulator.Accumulate(kCamera, Pose(), uncertain).equations.information;
  EXPECT_LT(b(3, 3), 0.2 * a(3, 3));  // shifts along x look like the deviation
  EXPECT_GT(b(4, 4), 0.5 * a(4, 4));
}

TEST(PointAccumulator, PointsBehindTheCameraAreSkipped) {
  auto points = Points(Pose());
  points[3].point_in_world.z() = -5;
  PointAccumulator accumulator;
  EXPECT_EQ(accumulator.Accumulate(kCamera, Pose(), points).num_points, 19);
  EXPECT_EQ(accumulator.Accumulate(kCamera, Pose(), {}).num_points, 0);
}

TEST(PriorEquations, OneStepReturnsToThePrior) {
  const PosePriorFactor prior{Pose(), 0.05, 0.2};
  const Vector6d delta = (Vector6d() << 0.02, -0.01, 0.03, 0.1, 0.2, -0.1).finished();
  const Rigid3 start = Perturb(Pose(), delta);
  const NormalEquations terms = PriorEquations(prior, start);
  for (int k = 0; k < 6; ++k) {
    const double sigma = k < 3 ? 0.05 : 0.2;
    EXPECT_NEAR(terms.gradient[k], delta[k] / (sigma * sigma), 1e-9);
  }
  const auto step = SolveStep(terms, 1.0);
  ASSERT_TRUE(step);
  EXPECT_LT(DistanceBetween(Perturb(start, *step), Pose()).position_m, 0.01);
}

TEST(PriorEquations, TiltIsHeldAcrossItsAxisOnly) {
  PosePriorFactor prior{Pose(), 0.1, 0.2};
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, 2) / 3.0;
  const Eigen::Vector3d across = Eigen::Vector3d(2, 1, -2) / 3.0;
  prior.tilt = TiltPrior{axis, 0.01};
  const Eigen::Matrix3d information = prior.Information().topLeftCorner<3, 3>();
  EXPECT_NEAR(axis.dot(information * axis), 1.0 / (0.1 * 0.1), 1e-9);
  EXPECT_NEAR(across.dot(information * across), 1.0 / (0.01 * 0.01), 1e-8);
  EXPECT_NEAR(axis.dot(information * across), 0.0, 1e-9);
  EXPECT_NEAR(prior.Information()(3, 3), 25.0, 1e-9);
}

TEST(SolveStep, LimitsTheRotationAndKeepsTheDirection) {
  NormalEquations equations;
  equations.information = Matrix6d::Identity();
  equations.gradient << 3, 4, 0, 1, 2, 3;
  const auto step = SolveStep(equations, 0.5);
  ASSERT_TRUE(step);
  EXPECT_NEAR(step->head<3>().norm(), 0.5, 1e-9);
  EXPECT_NEAR(step->normalized().dot(-equations.gradient.normalized()), 1.0, 1e-9);
}

TEST(SolveStep, BrokenEquationsHaveNoStep) {
  NormalEquations equations;
  equations.information = -Matrix6d::Identity();
  EXPECT_FALSE(SolveStep(equations, 0.1));
  equations.information.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(SolveStep(equations, 0.1));
}

TEST(NormalEquations, AddScalesBothParts) {
  NormalEquations a, b;
  b.information = Matrix6d::Identity();
  b.gradient = Vector6d::Ones();
  a.Add(b);
  a.Add(b, 0.5);
  EXPECT_EQ(a.information, 1.5 * Matrix6d::Identity());
  EXPECT_EQ(a.gradient, 1.5 * Vector6d::Ones());
}

}  // namespace
}  // namespace plumb
