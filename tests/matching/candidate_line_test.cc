#include "plumb/matching/candidate_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "support/line_scene.h"

namespace plumb {
namespace {

using testing::AsProjectedLines;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::LineScene;
using testing::MakeLineScene;

TEST(ProjectCandidates, AgreesWithProjectSegment) {
  const LineScene scene = MakeLineScene(200, /*seed=*/1);
  ProjectedLines projected;
  ProjectCandidates(scene.camera, scene.cam_from_world, scene.lines, 10.0, &projected);
  size_t row = 0;
  for (uint32_t i = 0; i < scene.lines.size(); ++i) {
    const auto image =
        ProjectSegment(scene.camera, scene.cam_from_world, scene.lines[i].segment_in_world);
    if (!image || !(image->Length() > 10.0)) continue;
    ASSERT_LT(row, projected.size());
    EXPECT_EQ(projected.line[row], i);
    EXPECT_NEAR(projected.x[row], image->start.x(), 1e-3);
    EXPECT_NEAR(projected.y[row], image->start.y(), 1e-3);
    EXPECT_NEAR(projected.length[row], image->Length(), 1e-3);
    EXPECT_NEAR(projected.direction_x[row], image->Delta().x() / image->Length(), 1e-6);
    EXPECT_NEAR(projected.direction_y[row], image->Delta().y() / image->Length(), 1e-6);
    EXPECT_NEAR(projected.weight[row], scene.lines[i].weight, 1e-6);
    ++row;
  }
  EXPECT_EQ(row, projected.size());
  EXPECT_GT(row, 100u);
}

TEST(ProjectCandidates, GivesAnglesFromZeroToBelowPi) {
  const LineScene scene = MakeLineScene(300, /*seed=*/2);
  ProjectedLines projected;
  ProjectCandidates(scene.camera, scene.cam_from_world, scene.lines, 0.0, &projected);
  for (size_t i = 0; i < projected.size(); ++i) {
    ASSERT_GE(projected.angle[i], 0.0f);
    ASSERT_LT(projected.angle[i], std::numbers::pi_v<float>);
    const double along = std::cos(projected.angle[i]) * projected.direction_x[i] +
                         std::sin(projected.angle[i]) * projected.direction_y[i];
    EXPECT_NEAR(std::abs(along), 1.0, 1e-6);
  }
}

TEST(ProjectCandidates, GivesBothDirectionsOfAHorizontalLineTheSameAngle) {
  const ProjectedLines lines =
      AsProjectedLines({{{10, 50}, {90, 50}}, {{90, 50}, {10, 50}}}, {1, 1});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_THAT(lines.angle, ElementsAre(0.0f, 0.0f));
  EXPECT_THAT(lines.direction_x, ElementsAre(1.0f, -1.0f));
}

TEST(ProjectCandidates, LeavesOutShortAndInvisibleLines) {
  const Camera camera{500.0, 500.0, 320.0, 240.0, 640, 480};
  std::vector<CandidateLine> lines(4);
  lines[0].segment_in_world = {{0.0, 0.0, 2.0}, {0.1, 0.0, 2.0}};    // 25 px
  lines[1].segment_in_world = {{0.0, 0.0, 2.0}, {0.2, 0.0, 2.0}};    // 50 px
  lines[2].segment_in_world = {{0.0, 0.0, -2.0}, {0.2, 0.0, -2.0}};  // behind
  lines[3].segment_in_world = {{10.0, 0.0, 2.0}, {12.0, 0.0, 2.0}};  // beside the image
  ProjectedLines projected;
  ProjectCandidates(camera, {}, lines, 26.0, &projected);
  EXPECT_THAT(projected.line, ElementsAre(1u));
  ProjectCandidates(camera, {}, {}, 26.0, &projected);
  EXPECT_THAT(projected.line, IsEmpty());
  EXPECT_THAT(projected.angle, IsEmpty());
}

TEST(MapVariancePx, IsTheVarianceAcrossTheLineSeenFromItsDistance) {
  const Camera camera{500.0, 500.0, 320.0, 240.0, 640, 480};
  CandidateLine line;
  line.segment_in_world = {{-0.5, 0.0, 2.0}, {0.5, 0.0, 2.0}};
  // 1 cm along y, which is across the line and the ray; the rest does not show.
  line.covariance_start.diagonal() << 9.0, 1e-4, 9.0;
  EXPECT_NEAR(MapVariancePx(camera, {}, line), 2.5 * 2.5, 1e-9);
  // The worse end point counts.
  line.covariance_end.diagonal() << 0.0, 4e-4, 0.0;
  EXPECT_NEAR(MapVariancePx(camera, {}, line), 5.0 * 5.0, 1e-9);
}

TEST(MapVariancePx, TurnsWithTheWorld) {
  const Camera camera{500.0, 500.0, 320.0, 240.0, 640, 480};
  CandidateLine line;
  line.segment_in_world = {{-0.5, 0.1, 2.0}, {0.5, 0.0, 3.0}};
  line.covariance_start.diagonal() << 1e-4, 2e-4, 3e-4;
  line.covariance_end = 2.0 * line.covariance_start;
  const double expected = MapVariancePx(camera, {}, line);
  const Rigid3 moved_from_world = {ExpSo3({0.4, 1.0, -0.6}), {1.0, 2.0, 3.0}};
  CandidateLine moved = line;
  const Eigen::Matrix3d r = moved_from_world.RotationMatrix();
  moved.segment_in_world = {moved_from_world * line.segment_in_world.start,
                            moved_from_world * line.segment_in_world.end};
  moved.covariance_start = r * line.covariance_start * r.transpose();
  moved.covariance_end = r * line.covariance_end * r.transpose();
  EXPECT_NEAR(MapVariancePx(camera, moved_from_world.Inverse(), moved), expected, 1e-9);
}

TEST(MapVariancePx, TakesDepthsAsAtLeast20Centimetres) {
  const Camera camera{500.0, 500.0, 320.0, 240.0, 640, 480};
  CandidateLine line;
  line.segment_in_world = {{-0.5, 0.0, 0.01}, {0.5, 0.0, 0.01}};
  line.covariance_start = line.covariance_end = 1e-4 * Eigen::Matrix3d::Identity();
  EXPECT_NEAR(MapVariancePx(camera, {}, line), 25.0 * 25.0, 1e-6);
}

TEST(MapVariancePx, IsZeroForALineThroughTheCentre) {
  CandidateLine line;
  line.segment_in_world = {{0.0, 0.0, 1.0}, {0.0, 0.0, 2.0}};
  line.covariance_start = Eigen::Matrix3d::Identity();
  EXPECT_EQ(MapVariancePx({500.0, 500.0, 320.0, 240.0, 640, 480}, {}, line), 0.0);
}

}  // namespace
}  // namespace plumb
