// The vectorised terms against their plain twins in double precision, and against Ceres.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "plumb/geometry/line_projection.h"
#include "plumb/refine/joint_solver.h"
#include "plumb/refine/line_terms.h"
#include "plumb/refine/point_terms.h"
#include "support/allocation_counter.h"

namespace plumb {
namespace {

const Camera kCamera{525.0, -480.0, 319.5, 239.5, 640, 480};

Rigid3 Truth() { return {ExpSo3({0.1, -0.2, 0.05}), {0.05, -0.1, 0.2}}; }
Rigid3 Start() {
  return Perturb(Truth(), (Vector6d() << 0.004, -0.003, 0.002, 0.01, 0.008, -0.012).finished());
}

struct Problem {
  std::vector<LineObservation> lines;
  std::vector<PointObservation> points;
};

/// Lines and points all over the image, with noise and a few that are wrong.
Problem MakeProblem(unsigned seed, int num_lines, int num_points) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> x(-1.2, 1.2), y(-0.9, 0.9), z(1.5, 5.0), unit(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.5);
  const Rigid3 world_from_cam = Truth().Inverse();
  Problem out;
  const auto disturbed = [&](const Eigen::Vector2d& px) -> Eigen::Vector2d {
    return px + Eigen::Vector2d(noise(rng), noise(rng));
  };
  for (int i = 0; i < num_lines; ++i) {
    const Eigen::Vector3d a(x(rng), y(rng), z(rng)), b(x(rng), y(rng), z(rng));
    const Eigen::Vector2d pa = kCamera.Project(a), pb = kCamera.Project(b);
    LineObservation& line = out.lines.emplace_back();
    line.line_in_world = {world_from_cam * a, world_from_cam * b};
    line.part_px = {disturbed(pa + 0.2 * (pb - pa)), disturbed(pa + 0.8 * (pb - pa))};
    line.weight = 0.2 + unit(rng);
    line.variance_px2 = 0.5 + unit(rng);
    if (i % 10 == 9) line.part_px.start.y() += 30.0;
  }
  for (int i = 0; i < num_points; ++i) {
    const Eigen::Vector3d p(x(rng), y(rng), z(rng));
    PointObservation& point = out.points.emplace_back();
    point.point_in_world = world_from_cam * p;
    point.pixel = disturbed(kCamera.Project(p));
    point.deviation_in_world =
        i % 7 == 0 ? Eigen::Vector3d::Zero()
                   : Eigen::Vector3d(world_from_cam.rotation * (0.01 * unit(rng) * p));
    point.weight = 0.2 + unit(rng);
    if (i % 6 == 5) point.pixel.x() -= 50.0;
  }
  return out;
}

/// Both ends of every observation's own line at a pose.
struct LineInput {
  LineInput(const std::vector<LineObservation>& lines, const Rigid3& pose) {
    observations.Resize(lines.size());
    for (size_t i = 0; i < lines.size(); ++i) {
      const Eigen::Vector3f a = (pose * lines[i].line_in_world.start).cast<float>();
      const Eigen::Vector3f b = (pose * lines[i].line_in_world.end).cast<float>();
      for (int c = 0; c < 3; ++c) {
        columns[c].push_back(a[c]);
        columns[3 + c].push_back(b[c]);
      }
      observations.line[i] = static_cast<int32_t>(i);
      observations.x0[i] = static_cast<float>(lines[i].part_px.start.x());
      observations.y0[i] = static_cast<float>(lines[i].part_px.start.y());
      observations.x1[i] = static_cast<float>(lines[i].part_px.end.x());
      observations.y1[i] = static_cast<float>(lines[i].part_px.end.y());
      observations.weight[i] = static_cast<float>(lines[i].weight);
      observations.variance_px2[i] = static_cast<float>(lines[i].variance_px2);
    }
  }
  LineEnds ends() const {
    return {columns[0].data(), columns[1].data(), columns[2].data(),
            columns[3].data(), columns[4].data(), columns[5].data()};
  }
  std::vector<float> columns[6];
  LineObservationTable observations;
};

void ExpectNear(const NormalEquations& a, const NormalEquations& plain) {
  const double scale = plain.information.norm();
  EXPECT_LT((a.information - plain.information).norm(), 1e-4 * scale + 1e-12);
  // Near the optimum the gradient is a small difference of large terms.
  EXPECT_LT((a.gradient - plain.gradient).norm(), 1e-6 * scale + 1e-12);
  EXPECT_EQ(a.information, Matrix6d(a.information.transpose()));
}

TEST(LineAccumulator, AgreesWithAccumulateLines) {
  LineAccumulator accumulator;
  for (const int count : {0, 1, 7, 8, 300, 700}) {
    const Problem problem = MakeProblem(static_cast<unsigned>(count) + 1, count, 0);
    const LineEquations plain = AccumulateLines(kCamera, Start(), problem.lines, 1.5);
    const LineInput input(problem.lines, Start());
    const LineEquations fast =
        accumulator.Accumulate(kCamera, input.ends(), input.observations, 1.5, LineLoss::kEachEnd);
    ExpectNear(fast.equations, plain.equations);
    EXPECT_NEAR(fast.residual_scale, plain.residual_scale, 1e-4 * plain.residual_scale);
    EXPECT_EQ(fast.num_residuals, plain.num_residuals);
  }
}

TEST(LineAccumulator, LinesThroughTheCentreCountForNothing) {
  Problem problem = MakeProblem(3, 20, 0);
  const LineEquations without = AccumulateLines(kCamera, Truth(), problem.lines, 2.0);
  LineObservation bad = problem.lines[0];
  const Rigid3 world_from_cam = Truth().Inverse();
  bad.line_in_world = {world_from_cam * Eigen::Vector3d(0, 0, 1),
                       world_from_cam * Eigen::Vector3d(0, 0, 2)};
  problem.lines.push_back(bad);
  LineAccumulator accumulator;
  const LineInput input(problem.lines, Truth());
  ExpectNear(
      accumulator.Accumulate(kCamera, input.ends(), input.observations, 2.0, LineLoss::kEachEnd)
          .equations,
      without.equations);
}

TEST(PointTableAccumulator, AgreesWithPointAccumulator) {
  PointAccumulator plain_accumulator;
  PointTableAccumulator accumulator;
  PointTable table;
  for (const int count : {1, 8, 13, 500}) {
    const Problem problem = MakeProblem(static_cast<unsigned>(count), 0, count);
    const auto plain = plain_accumulator.Accumulate(kCamera, Start(), problem.points);
    table.Assign(problem.points, Truth());
    const auto fast = accumulator.Accumulate(kCamera, Start(), table);
    EXPECT_EQ(fast.num_points, plain.num_points);
    EXPECT_NEAR(fast.scale, plain.scale, 1e-3 * plain.scale);
    ExpectNear(fast.equations, plain.equations);
  }
  table.Assign({}, Truth());
  EXPECT_EQ(accumulator.Accumulate(kCamera, Start(), table).num_points, 0);
}

TEST(PointTableAccumulator, PointsBehindTheCameraAreSkipped) {
  Problem problem = MakeProblem(5, 0, 30);
  PointTable table;
  table.Assign(problem.points, Truth());
  PointTableAccumulator accumulator;
  const auto without = accumulator.Accumulate(kCamera, Truth(), table);
  problem.points.push_back({{100, 100}, Truth().Inverse() * Eigen::Vector3d(0, 0, -1), {0, 0, 0}});
  table.Assign(problem.points, Truth());
  const auto with = accumulator.Accumulate(kCamera, Truth(), table);
  EXPECT_EQ(with.num_points, without.num_points);
  ExpectNear(with.equations, without.equations);
}

TEST(PointTableAccumulator, FindsThePointsNearTheirPixels) {
  const Problem problem = MakeProblem(6, 0, 61);
  PointTable table, near;
  table.Assign(problem.points, Start());
  PointTableAccumulator accumulator;
  std::vector<uint32_t> rows;
  accumulator.FindNear(kCamera, Truth(), table, 10.0, &rows);
  std::vector<uint32_t> expected;
  for (uint32_t i = 0; i < problem.points.size(); ++i) {
    if (i % 6 != 5) expected.push_back(i);
  }
  EXPECT_EQ(rows, expected);
  near.AssignRows(table, rows);
  EXPECT_EQ(near.size(), expected.size());
  EXPECT_EQ(near.u[5], table.u[6]);
}

TEST(PointTable, RowsOfOnePixelShareTheWeightOfOne) {
  Problem problem = MakeProblem(7, 0, 6);
  for (const int i : {2, 5}) problem.points[i].pixel = problem.points[0].pixel;
  problem.points[4].pixel = {problem.points[3].pixel.x(), problem.points[3].pixel.y() + 1.0};
  PointTable table;
  table.Assign(problem.points, Start());
  EXPECT_EQ(table.ShareWeights(), 4u);
  const std::vector<float> third{1.0f / 3, 1.0f, 1.0f / 3, 1.0f, 1.0f, 1.0f / 3};
  EXPECT_EQ(table.weight, third);

  // Three observations that share a weight are worth one of full weight.
  problem.points.resize(1);
  problem.points[0].weight = 1.0;
  PointTableAccumulator accumulator;
  table.Assign(problem.points, Start());
  const auto one = accumulator.Accumulate(kCamera, Start(), table);
  problem.points.resize(3, problem.points[0]);
  table.Assign(problem.points, Start());
  EXPECT_EQ(table.ShareWeights(), 1u);
  ExpectNear(accumulator.Accumulate(kCamera, Start(), table).equations, one.equations);
}

TEST(PointTable, NoRowsHaveNoPixels) {
  PointTable table;
  table.Assign({}, Start());
  EXPECT_EQ(table.ShareWeights(), 0u);
}

TEST(SinglePrecision, StepsLeadToTheOptimumThatCeresFinds) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Problem problem = MakeProblem(seed, 80, 60);
    const PosePriorFactor prior{Start(), 0.2, 0.5};
    const auto solution =
        SolveOverlapCost(kCamera, Start(), problem.lines, problem.points, &prior,
                         {.line_robust = 1.5, .point_robust = 3.0, .max_iterations = 100});
    ASSERT_TRUE(solution);
    LineAccumulator line_terms;
    PointTableAccumulator point_terms;
    PointTable points;
    points.Assign(problem.points, Start());
    Rigid3 pose = Start();
    for (int i = 0; i < 30; ++i) {
      const LineInput input(problem.lines, pose);
      NormalEquations equations = PriorEquations(prior, pose);
      equations.Add(
          line_terms.Accumulate(kCamera, input.ends(), input.observations, 1.5, LineLoss::kBothEnds)
              .equations);
      equations.Add(point_terms.Accumulate(kCamera, pose, points, 1.0).equations);
      const auto step = SolveStep(equations, 0.1);
      ASSERT_TRUE(step);
      pose = Perturb(pose, *step);
    }
    const PoseDistance distance = DistanceBetween(pose, solution->cam_from_world);
    EXPECT_LT(distance.position_m, 2e-5) << seed;
    EXPECT_LT(distance.rotation_rad, 1e-5) << seed;
  }
}

TEST(SinglePrecision, DoesNotAllocateOnceWarm) {
  const Problem problem = MakeProblem(4, 100, 100);
  const LineInput input(problem.lines, Truth());
  PointTable table;
  table.Assign(problem.points, Truth());
  LineAccumulator line_terms;
  PointTableAccumulator point_terms;
  line_terms.Accumulate(kCamera, input.ends(), input.observations, 2.0, LineLoss::kEachEnd);
  point_terms.Accumulate(kCamera, Truth(), table);
  const size_t before = testing::num_allocations;
  line_terms.Accumulate(kCamera, input.ends(), input.observations, 2.0, LineLoss::kEachEnd);
  point_terms.Accumulate(kCamera, Truth(), table);
  EXPECT_EQ(testing::num_allocations, before);
}

}  // namespace
}  // namespace plumb
