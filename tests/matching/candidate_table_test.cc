#include "plumb/matching/candidate_table.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "support/allocation_counter.h"
#include "support/line_scene.h"

namespace plumb {
namespace {

using testing::LineScene;
using testing::MakeLineScene;

Rigid3 Near(const Rigid3& pose) {
  return Rigid3{ExpSo3({0.03, -0.02, 0.04}), {0.1, -0.05, 0.08}} * pose;
}

void ExpectAsPlain(const Camera& camera, const Rigid3& pose,
                   const std::vector<CandidateLine>& lines, const Rigid3& reference) {
  ProjectedLines plain, fast;
  ProjectCandidates(camera, pose, lines, 10.0, &plain);
  CandidateTable table;
  table.Assign(lines, reference);
  ProjectTable(camera, pose, table, 10.0, &fast);
  ASSERT_EQ(fast.size() % CandidateTable::kLanes, 0u);
  std::vector<size_t> row_of(fast.size(), plain.size());
  for (size_t row = 0; row < plain.size(); ++row) row_of[plain.line[row]] = row;
  for (size_t i = 0; i < fast.size(); ++i) {
    const size_t row = row_of[i];
    if (row == plain.size()) {
      // At the limit of 10 px the two may disagree.
      EXPECT_LT(fast.length[i], 10.01f) << i;
      continue;
    }
    EXPECT_NEAR(fast.length[i], plain.length[row], 5e-3) << i;
    EXPECT_NEAR(fast.x[i], plain.x[row], 5e-3) << i;
    EXPECT_NEAR(fast.y[i], plain.y[row], 5e-3) << i;
    EXPECT_NEAR(fast.direction_x[i], plain.direction_x[row], 1e-4) << i;
    EXPECT_NEAR(fast.direction_y[i], plain.direction_y[row], 1e-4) << i;
    EXPECT_NEAR(std::remainder(fast.angle[i] - plain.angle[row], 3.14159265f), 0.0, 0.0045) << i;
    EXPECT_EQ(fast.weight[i], plain.weight[row]) << i;
    const Eigen::Vector3d start = pose * lines[i].segment_in_world.start;
    EXPECT_NEAR(fast.start_x[i], start.x(), 1e-5);
    EXPECT_NEAR(fast.start_z[i], start.z(), 1e-5);
  }
}

TEST(CandidateTable, ProjectsAsProjectCandidatesDoes) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const LineScene scene = MakeLineScene(203, seed);
    ExpectAsPlain(scene.camera, scene.cam_from_world, scene.lines, scene.cam_from_world);
    ExpectAsPlain(scene.camera, Near(scene.cam_from_world), scene.lines, scene.cam_from_world);
  }
}

TEST(CandidateTable, MirroredAxesAreProjectedToo) {
  LineScene scene = MakeLineScene(100, 9);
  scene.camera.fy = -scene.camera.fy;
  ExpectAsPlain(scene.camera, Near(scene.cam_from_world), scene.lines, scene.cam_from_world);
}

TEST(CandidateTable, IsAsExactFarFromTheWorldsOrigin) {
  LineScene scene = MakeLineScene(64, 3);
  const Rigid3 far{Eigen::Quaterniond::Identity(), {12'345.0, -6'789.0, 4'321.0}};
  for (CandidateLine& line : scene.lines) {
    line.segment_in_world = {far * line.segment_in_world.start, far * line.segment_in_world.end};
  }
  const Rigid3 pose = scene.cam_from_world * far.Inverse();
  ExpectAsPlain(scene.camera, pose, scene.lines, pose);
}

TEST(CandidateTable, LinesBehindTheCameraOrWithoutExtentAreNotVisible) {
  std::vector<CandidateLine> lines(3);
  lines[0].segment_in_world = {{0, 0, -1}, {1, 0, -2}};
  lines[1].segment_in_world = {{0, 0, 2}, {0, 0, 2}};
  lines[2].segment_in_world = {{0, 0, 1}, {0, 0, 3}};  // along the axis: a point
  CandidateTable table;
  table.Assign(lines, {});
  ProjectedLines projected;
  ProjectTable({500, 500, 320, 240, 640, 480}, {}, table, 1.0, &projected);
  for (const float length : projected.length) EXPECT_EQ(length, 0.0f);
}

TEST(CandidateTable, LinesWithNaNAreNotVisible) {
  std::vector<CandidateLine> lines(1);
  lines[0].segment_in_world = {{std::numeric_limits<double>::quiet_NaN(), 0, 2}, {1, 0, 2}};
  CandidateTable table;
  table.Assign(lines, {});
  ProjectedLines projected;
  ProjectTable({500, 500, 320, 240, 640, 480}, {}, table, 1.0, &projected);
  EXPECT_EQ(projected.length[0], 0.0f);
}

TEST(CandidateTable, DoesNotAllocateOnceWarm) {
  const LineScene scene = MakeLineScene(200, 4);
  CandidateTable table;
  ProjectedLines projected;
  table.Assign(scene.lines, scene.cam_from_world);
  ProjectTable(scene.camera, scene.cam_from_world, table, 10.0, &projected);
  const size_t before = testing::num_allocations;
  table.Assign(scene.lines, scene.cam_from_world);
  ProjectTable(scene.camera, scene.cam_from_world, table, 10.0, &projected);
  EXPECT_EQ(testing::num_allocations, before);
}

}  // namespace
}  // namespace plumb
