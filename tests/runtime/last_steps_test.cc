// The steps after the search: local lines, points, matches.
#include "plumb/runtime/last_steps.h"

#include <numbers>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "support/synthetic_room.h"

namespace plumb {
namespace {

using testing::LookAlong;

const Rigid3 kPose = LookAlong({-0.6, 0.2, 0.1}, {1.0, 0.5, -0.1});

/// A room, its map, and what a camera at kPose sees of it.
struct View {
  explicit View(const std::vector<Rigid3>& key_frames = testing::RoomKeyFrames())
      : map(testing::MapOf(lines, key_frames)) {
    segments.Assign(testing::Render(lines, kPose, 1), 250);
    table.Assign(points, kPose);
    steps.Begin({testing::RoomCamera(), &segments, points, &table});
  }

  std::vector<Segment3> lines = testing::RoomLines();
  LineMap map;
  MapIndex index{map};
  FineLines fine_lines{index};
  FrameSegments segments;
  std::vector<PointObservation> points;
  PointTable table;
  LastSteps steps{index, &fine_lines};
};

FineAlignment NearPose(uint64_t seed) {
  Random random(seed);
  FineAlignment alignment;
  alignment.cam_from_world = testing::Disturb(kPose, 0.01, 0.2 * std::numbers::pi / 180.0, &random);
  return alignment;
}

PosePriorFactor WeakAt(const FineAlignment& alignment) {
  return {alignment.cam_from_world, 0.1, 0.2};
}

TEST(LastSteps, LocalLinesImproveAPose) {
  View view;
  for (uint64_t seed = 0; seed < 4; ++seed) {
    FineAlignment alignment = NearPose(seed);
    ASSERT_TRUE(view.steps.AlignOnLocalLines(WeakAt(alignment), &alignment));
    EXPECT_LT(DistanceBetween(alignment.cam_from_world, kPose).position_m, 0.004);
    EXPECT_GE(view.steps.local_lines().size(), 20u);
  }
}

TEST(LastSteps, FewLocalLinesLeaveThePoseAlone) {
  View view({LookAlong({-0.6, 0.2, 0.1}, {-1.0, -0.5, 0.1})});  // looks the other way
  FineAlignment alignment = NearPose(1);
  const Rigid3 before = alignment.cam_from_world;
  EXPECT_FALSE(view.steps.AlignOnLocalLines(WeakAt(alignment), &alignment));
  EXPECT_EQ(alignment.cam_from_world.translation, before.translation);
  EXPECT_LT(view.steps.local_lines().size(), 20u);
}

TEST(LastSteps, WithoutPointsNothingIsJoint) {
  View view;
  FineAlignment alignment = NearPose(2);
  const Rigid3 before = alignment.cam_from_world;
  view.steps.AlignWithPoints(WeakAt(alignment), &alignment);
  EXPECT_EQ(alignment.cam_from_world.translation, before.translation);
  EXPECT_EQ(alignment.num_points, 0);
}

TEST(LastSteps, ASegmentMatchesOneLine) {
  View view;
  std::vector<LineMatch> matches;
  view.steps.AppendMatches(kPose, &matches);
  ASSERT_GT(matches.size(), 15u);
  std::set<uint32_t> seen;
  for (const LineMatch& match : matches) {
    EXPECT_TRUE(seen.insert(match.segment).second) << "segment " << match.segment;
    EXPECT_LT(match.line, view.map.lines.size());
    EXPECT_LT(match.distance_px, 6.0);
  }
}

}  // namespace
}  // namespace plumb
