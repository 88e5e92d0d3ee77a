#include "plumb/runtime/line_selection.h"

#include <numbers>
#include <set>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "plumb/geometry/line_projection.h"
#include "plumb/map/depth_view.h"
#include "plumb/runtime/fine_alignment.h"
#include "plumb/runtime/point_solver.h"
#include "support/synthetic_room.h"

namespace plumb {
namespace {

using testing::LookAlong;

constexpr double kDegree = std::numbers::pi / 180.0;

const Rigid3 kPose = LookAlong({-0.6, 0.2, 0.1}, {1.0, 0.5, -0.1});

struct Room {
  std::vector<Segment3> lines = testing::RoomLines();
  LineMap map = testing::MapOf(lines, testing::RoomKeyFrames());
  MapIndex index{map};
  LineSelector selector{index};
  Camera camera = testing::RoomCamera();
};

TEST(LineWeight, GrowsWithStabilityAndViews) {
  const auto weight = [](uint32_t observing, uint32_t expected) {
    MapLine line;
    line.num_observing = observing;
    line.num_expected = expected;
    return LineWeight(line);
  };
  EXPECT_DOUBLE_EQ(weight(3, 3), 1.0);
  EXPECT_DOUBLE_EQ(weight(9, 12), 1.0);  // seen in more than two of three is enough
  EXPECT_NEAR(weight(3, 30), 0.3 + 0.7 * 0.15, 1e-12);
  EXPECT_NEAR(weight(1, 1), 1.0 / 3, 1e-12);
  EXPECT_EQ(weight(0, 0), 0.0);
}

TEST(LineSelector, ListsAreVisibleBoundedAndBestFirst) {
  Room room;
  std::vector<CandidateLine> search, fine;
  room.selector.SelectForSearch(room.camera, kPose, 2.0 * kDegree, &search);
  room.selector.SelectForAlignment(room.camera, kPose, &fine);
  ASSERT_GT(fine.size(), 20u);
  EXPECT_LE(search.size(), 300u);
  EXPECT_LE(fine.size(), 250u);
  EXPECT_GE(search.size(), fine.size());
  std::set<uint32_t> ids;
  double last = 1e9;
  for (const CandidateLine& line : fine) {
    EXPECT_TRUE(ids.insert(line.id).second) << "line " << line.id << " twice";
    const auto image = ProjectSegment(room.camera, kPose, line.segment_in_world, 60.0);
    ASSERT_TRUE(image);
    const double value = line.weight * std::min(image->Length(), 150.0);
    EXPECT_LE(value, last + 1e-4);
    last = value;
  }
}

TEST(LineSelector, LocalLinesCarryTheUncertaintyOfTheirDepth) {
  Room room;
  std::vector<CandidateLine> local;
  room.selector.SelectLocal(room.camera, kPose, &local);
  ASSERT_GT(local.size(), 20u);
  EXPECT_LE(local.size(), 400u);
  for (const CandidateLine& line : local) {
    EXPECT_EQ(line.weight, 1.0);
    const Eigen::Vector3d variances =
        line.covariance_start.selfadjointView<Eigen::Lower>().eigenvalues();
    EXPECT_GT(variances[0], 0.0);
    EXPECT_LT(variances[2], 0.2 * 0.2);
    // Seen by one of the key frames, the deviation of the end's depth is the depth sensor's,
    // wherever in the image it lies.
    bool is_of_a_key_frame = false;
    for (const KeyFrame& frame : room.map.key_frames) {
      const Eigen::Vector3d ray =
          line.segment_in_world.start - frame.cam_from_world.Inverse().translation;
      const Eigen::Vector3d axis = frame.cam_from_world.RotationMatrix().row(2);
      const double depth = axis.dot(ray), sigma = DepthNoise{}.SigmaAt(depth);
      const double along = ray.dot(line.covariance_start * ray) / ray.squaredNorm();
      is_of_a_key_frame |=
          std::abs(std::sqrt(along) * depth / ray.norm() - sigma) < 1e-9 + 1e-6 * sigma;
    }
    EXPECT_TRUE(is_of_a_key_frame);
  }
}

TEST(LineSelector, NothingIsVisibleFromFarOutside) {
  Room room;
  std::vector<CandidateLine> lines(5);
  const Rigid3 away = LookAlong({100, 0, 0}, {1, 0, 0});
  room.selector.SelectForSearch(room.camera, away, 0.03, &lines);
  EXPECT_TRUE(lines.empty());
  room.selector.SelectForAlignment(room.camera, away, &lines);
  EXPECT_TRUE(lines.empty());
  room.selector.SelectLocal(room.camera, away, &lines);
  EXPECT_TRUE(lines.empty());
}

TEST(FrameSegments, KeepTheLongestWithTheirNames) {
  const std::vector<Segment2> all = {
      {{0, 0}, {10, 0}}, {{0, 0}, {50, 0}}, {{0, 0}, {20, 0}}, {{5, 5}, {55, 5}}};
  FrameSegments kept;
  kept.Assign(all, 3);
  EXPECT_EQ(kept.source, (std::vector<uint32_t>{1, 3, 2}));
  EXPECT_EQ(kept.segments[2].end.x(), 20.0);
  EXPECT_EQ(kept.table.size(), 3u);
  kept.Assign({}, 3);
  EXPECT_TRUE(kept.segments.empty());
}

TEST(FineLines, AreSelectedAnewOnlyForAPoseFarAway) {
  Room room;
  FineLines fine(room.index);
  std::vector<CandidateLine> expected;
  const auto ids = [](const std::vector<CandidateLine>& lines) {
    std::vector<uint32_t> out;
    for (const CandidateLine& line : lines) out.push_back(line.id);
    return out;
  };
  room.selector.SelectForAlignment(room.camera, kPose, &expected);
  EXPECT_EQ(ids(fine.Near(room.camera, kPose)), ids(expected));
  const auto turned = [](double radians) {
    const Eigen::Quaterniond turn = ExpSo3({0.0, radians, 0.0});
    return Rigid3{(turn * kPose.rotation).normalized(), turn * kPose.translation};
  };
  EXPECT_EQ(ids(fine.Near(room.camera, turned(0.03))), ids(expected));
  const Rigid3 away = turned(0.5);
  room.selector.SelectForAlignment(room.camera, away, &expected);
  EXPECT_EQ(ids(fine.Near(room.camera, away)), ids(expected));
  EXPECT_EQ(ids(fine.lines()), ids(expected));
  // Near enough to keep, but of another frame.
  const Rigid3 beside = turned(0.52);
  room.selector.SelectForAlignment(room.camera, beside, &expected);
  fine.Forget();
  EXPECT_EQ(ids(fine.Near(room.camera, beside)), ids(expected));
}

TEST(FineAligner, ReachesThePoseFromWithinTheWidestGate) {
  Room room;
  std::vector<CandidateLine> lines;
  room.selector.SelectForAlignment(room.camera, kPose, &lines);
  FrameSegments segments;
  segments.Assign(testing::Render(room.lines, kPose, 1), 250);
  Random random(2);
  FineAligner aligner;
  for (int k = 0; k < 5; ++k) {
    const Rigid3 start = testing::Disturb(kPose, 0.02, 0.5 * kDegree, &random);
    aligner.Begin(room.camera, start, lines, segments);
    const FineAlignment aligned = aligner.Run(start, FineSchedule(), {start, 0.1, 0.2});
    EXPECT_LT(DistanceBetween(aligned.cam_from_world, kPose).position_m, 0.006);
    EXPECT_GT(aligned.num_pairs, 20u);
    EXPECT_EQ(aligned.num_points, 0);
  }
}

TEST(FineAligner, WithoutPairsThePoseStays) {
  FineAligner aligner;
  FrameSegments none;
  none.Assign({}, 10);
  aligner.Begin(testing::RoomCamera(), kPose, {}, none);
  const FineAlignment aligned = aligner.Run(kPose, FineSchedule(), {kPose, 0.1, 0.1});
  EXPECT_EQ(aligned.cam_from_world.translation, kPose.translation);
  EXPECT_EQ(aligned.line_information, Matrix6d(Matrix6d::Zero()));
}

TEST(AlignmentSchedules, NarrowFromStepToStep) {
  for (const auto schedule : {FineSchedule(), StreamSchedule(), LocalSchedule(), JointSchedule()}) {
    ASSERT_FALSE(schedule.empty());
    EXPECT_EQ(schedule.back().sigma_px, 1.0);
    for (size_t i = 1; i < schedule.size(); ++i) {
      EXPECT_LE(schedule[i].sigma_px, schedule[i - 1].sigma_px);
      EXPECT_LE(schedule[i].sigma_sine, schedule[i - 1].sigma_sine);
    }
  }
}

TEST(PointSolver, FindsThePoseAmongWrongPoints) {
  Random random(5);
  const Camera camera = testing::RoomCamera();
  std::vector<PointObservation> points;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d x(testing::UniformIn(&random, -1, 1),
                            testing::UniformIn(&random, -0.8, 0.8),
                            testing::UniformIn(&random, 2, 4));
    PointObservation& point = points.emplace_back();
    point.point_in_world = kPose.Inverse() * x;
    point.pixel = camera.Project(x);
    if (i % 4 == 0) point.pixel.y() += 80;
  }
  PointSolver solver;
  PointTable table;
  table.Assign(points, kPose);
  const Rigid3 prior = testing::Disturb(kPose, 0.3, 6.0 * kDegree, &random);
  const PointPose pose = solver.Solve(camera, {prior, 0.3, 0.6}, table);
  EXPECT_EQ(pose.num_inliers, 45u);
  EXPECT_LT(DistanceBetween(pose.cam_from_world, kPose).position_m, 0.003);
}

}  // namespace
}  // namespace plumb
