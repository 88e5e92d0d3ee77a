#include "plumb/refine/joint_solver.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace plumb {
namespace {

const Camera kCamera{525.0, 525.0, 319.5, 239.5, 640, 480};

Rigid3 Truth() { return {ExpSo3({0.1, -0.2, 0.05}), {0.05, -0.1, 0.2}}; }
Rigid3 Start() {
  return Perturb(Truth(), (Vector6d() << 0.01, -0.008, 0.006, 0.02, 0.015, -0.03).finished());
}

std::vector<Segment3> Lines() {
  return {{{-0.4, 0.3, 2.5}, {0.7, -0.2, 3.4}}, {{0.5, 0.5, 2.0}, {0.6, -0.6, 2.2}},
          {{-0.8, 0.1, 3.0}, {0.4, 0.2, 2.4}},  {{0, 0.4, 4.0}, {0.9, 0.5, 3.5}},
          {{-0.5, -0.5, 2}, {-0.5, 0.6, 2.8}},  {{-0.9, -0.4, 3}, {0.3, -0.5, 3}},
          {{0.2, 0.2, 2.1}, {0.8, 0.1, 2.9}},   {{-0.7, 0.6, 2.6}, {0.1, 0.5, 2.2}}};
}

/// A loss wide enough to reach the truth from Start().
constexpr JointSolverOptions kWide{.line_robust = 30.0, .point_robust = 30.0};

Segment2 ImageOf(const Segment3& line, double from = 0.0, double to = 1.0) {
  const Eigen::Vector2d a = kCamera.Project(Truth() * line.start);
  const Eigen::Vector2d b = kCamera.Project(Truth() * line.end);
  return {a + from * (b - a), a + to * (b - a)};
}

std::vector<PaperLine> PaperLines() {
  std::vector<PaperLine> out;
  for (const Segment3& line : Lines()) {
    const Segment2 image = ImageOf(line);
    out.push_back({line, image, image.Length()});
  }
  return out;
}

std::vector<LineObservation> Overlaps() {
  std::vector<LineObservation> out;
  double from = 0.0;
  for (const Segment3& line : Lines()) {
    out.push_back({line, ImageOf(line, from, from + 0.4), 1.0, 0.5});
    from += 0.07;
  }
  return out;
}

std::vector<PointObservation> Points() {
  std::vector<PointObservation> out;
  for (int i = 0; i < 16; ++i) {
    PointObservation& p = out.emplace_back();
    p.point_in_world = {0.3 * (i % 4) - 0.5, 0.25 * (i / 4) - 0.4, 2.0 + 0.15 * (i % 5)};
    p.pixel = kCamera.Project(Truth() * p.point_in_world);
  }
  return out;
}

void ExpectAtTruth(const std::optional<JointSolution>& solution, double tolerance = 1e-4) {
  ASSERT_TRUE(solution);
  const PoseDistance error = DistanceBetween(solution->cam_from_world, Truth());
  EXPECT_LT(error.position_m, tolerance);
  EXPECT_LT(error.rotation_rad, tolerance);
  EXPECT_LE(solution->final_cost, solution->initial_cost);
}

TEST(SolvePaperCost, RecoversThePoseFromLines) {
  const auto solution = SolvePaperCost(kCamera, Start(), PaperLines(), {}, {});
  ExpectAtTruth(solution);
  EXPECT_EQ(solution->num_lines, 8);
  EXPECT_EQ(solution->num_points, 0);
}

TEST(SolvePaperCost, PerpendicularDistancesForgiveFragments) {
  std::vector<PaperLine> fragments;
  for (const LineObservation& overlap : Overlaps()) {
    fragments.push_back({overlap.line_in_world, overlap.part_px, overlap.part_px.Length()});
  }
  ExpectAtTruth(SolvePaperCost(kCamera, Start(), fragments, {},
                               {.paper_residual = LineResidual::kPerpendicular}));
  // The midpoints of fragments are elsewhere.
  const auto midpoints = SolvePaperCost(kCamera, Start(), fragments, {}, {});
  ASSERT_TRUE(midpoints);
  EXPECT_GT(DistanceBetween(midpoints->cam_from_world, Truth()).position_m, 0.01);
}

TEST(SolvePaperCost, RecoversThePoseFromPointsAlone) {
  ExpectAtTruth(SolvePaperCost(kCamera, Start(), {}, Points(), {}));
}

TEST(SolvePaperCost, RecoversThePoseFromBothDespiteAnOutlier) {
  auto points = Points();
  points[5].pixel.x() += 200;
  const auto solution = SolvePaperCost(kCamera, Start(), PaperLines(), points, {});
  ExpectAtTruth(solution, 5e-3);
  EXPECT_EQ(solution->num_points, 16);
}

TEST(SolveOverlapCost, FragmentsDoNotBiasThePose) {
  ExpectAtTruth(SolveOverlapCost(kCamera, Start(), Overlaps(), {}, nullptr, kWide));
}

TEST(SolveOverlapCost, JointWithPointsAndPrior) {
  const PosePriorFactor prior{Start(), 0.1, 0.5};
  const auto solution = SolveOverlapCost(kCamera, Start(), Overlaps(), Points(), &prior, kWide);
  ExpectAtTruth(solution, 2e-3);
  EXPECT_EQ(solution->num_lines, 8);
  EXPECT_EQ(solution->num_points, 16);
}

TEST(SolveOverlapCost, ATightPriorHoldsThePose) {
  const PosePriorFactor prior{Start(), 1e-6, 1e-6};
  const auto solution = SolveOverlapCost(kCamera, Start(), Overlaps(), {}, &prior, {});
  ASSERT_TRUE(solution);
  EXPECT_LT(DistanceBetween(solution->cam_from_world, Start()).position_m, 1e-4);
}

TEST(SolveOverlapCost, LinesWithoutImageAreLeftOut) {
  auto lines = Overlaps();
  const Eigen::Vector3d center = Start().Center();
  const Eigen::Vector3d ray = Start().rotation.conjugate() * Eigen::Vector3d::UnitZ();
  lines[0].line_in_world = {center + ray, center + 2 * ray};
  const auto solution = SolveOverlapCost(kCamera, Start(), lines, {}, nullptr, {});
  ASSERT_TRUE(solution);
  EXPECT_EQ(solution->num_lines, 7);
}

TEST(SolveOverlapCost, FarOutliersHaveNoSay) {
  auto lines = Overlaps();
  auto points = Points();
  lines[3].part_px.start.y() += 60;
  lines[3].part_px.end.y() += 60;
  points[5].pixel.x() += 200;
  const auto solution = SolveOverlapCost(kCamera, Truth(), lines, points, nullptr, {});
  ExpectAtTruth(solution, 1e-4);
}

TEST(SolveOverlapCost, GaussNewtonStepsLeadToTheSamePose) {
  auto lines = Overlaps();
  for (size_t i = 0; i < lines.size(); ++i) {
    const Eigen::Vector2d off(0.3 * std::sin(3.0 * static_cast<double>(i)), 0.25);
    lines[i].part_px.start += off;
    lines[i].part_px.end += off;  // equal at both ends: one loss per block or per end is the same
  }
  const auto solution =
      SolveOverlapCost(kCamera, Truth(), lines, {}, nullptr, {.max_iterations = 100});
  ASSERT_TRUE(solution);
  Rigid3 pose = Truth();
  for (int i = 0; i < 100; ++i) {
    const auto step = SolveStep(AccumulateLines(kCamera, pose, lines, 1.0).equations, 0.1);
    ASSERT_TRUE(step);
    pose = Perturb(pose, *step);
  }
  EXPECT_LT(DistanceBetween(pose, solution->cam_from_world).position_m, 1e-3);
}

TEST(JointSolver, BrokenInputHasNoSolution) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(SolvePaperCost(kCamera, Start(), {}, {}, {}));
  EXPECT_FALSE(SolveOverlapCost(kCamera, Start(), {}, {}, nullptr, {}));
  Rigid3 bad = Start();
  bad.translation.x() = nan;
  EXPECT_FALSE(SolvePaperCost(kCamera, bad, PaperLines(), {}, {}));
  auto lines = PaperLines();
  lines[2].segment_px.end.y() = nan;
  EXPECT_FALSE(SolvePaperCost(kCamera, Start(), lines, {}, {}));
  auto overlaps = Overlaps();
  overlaps[1].variance_px2 = 0.0;
  EXPECT_FALSE(SolveOverlapCost(kCamera, Start(), overlaps, {}, nullptr, {}));
  EXPECT_FALSE(SolvePaperCost(kCamera, Start(), PaperLines(), {}, {.huber_px = -1.0}));
  EXPECT_FALSE(SolvePaperCost(Camera{}, Start(), PaperLines(), {}, {}));
}

}  // namespace
}  // namespace plumb
