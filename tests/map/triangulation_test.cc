// Segments lifted without depth lie on the true lines, and motion that tells no depth gives none.
#include "plumb/map/triangulation.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/geometry/line_projection.h"
#include "support/synthetic_room.h"

namespace plumb {
namespace {

using testing::LookAlong;

using testing::RenderOptions;
using testing::RoomCamera;
using testing::RoomLines;

struct Recording {
  std::vector<Rigid3> poses;
  std::vector<std::vector<Segment2>> segments;

  std::vector<std::vector<TriangulatedSegment>> Lift(
      const TriangulationOptions& options = {}) const {
    std::vector<SegmentView> views;
    for (size_t k = 0; k < poses.size(); ++k) {
      views.push_back({RoomCamera(), poses[k], segments[k]});
    }
    return TriangulateSegments(views, options);
  }
};

Recording Record(const std::vector<Segment3>& lines, const std::vector<Rigid3>& poses,
                 const RenderOptions& options = {}) {
  Recording recording{poses, {}};
  for (size_t k = 0; k < poses.size(); ++k) {
    recording.segments.push_back(testing::Render(lines, poses[k], 100 + k, options));
  }
  return recording;
}

// A walk of 2 m along a wall, with some turning, about 3 m away from it.
std::vector<Rigid3> Walk(int count) {
  std::vector<Rigid3> poses;
  for (int k = 0; k < count; ++k) {
    const double s = 2.0 * k / (count - 1) - 1.0;
    poses.push_back(
        LookAlong({-0.6 + 0.1 * s, s, 0.2 * std::sin(3.0 * s)}, {1.0, -0.3 * s, -0.05}));
  }
  return poses;
}

size_t Count(const std::vector<std::vector<TriangulatedSegment>>& lifted) {
  size_t count = 0;
  for (const auto& view : lifted) count += view.size();
  return count;
}

// Distance of the lifted segment's farther end from the line that is nearest to both ends.
double ErrorOf(const TriangulatedSegment& segment, const std::vector<Segment3>& lines) {
  double least = 1e9;
  for (const Segment3& line : lines) {
    const Eigen::Vector3d direction = line.Delta().normalized();
    const auto distance = [&](const Eigen::Vector3d& x) {
      return direction.cross(x - line.start).norm();
    };
    least = std::min(least, std::max(distance(segment.segment_in_world.start),
                                     distance(segment.segment_in_world.end)));
  }
  return least;
}

TEST(Triangulation, LiftedSegmentsLieOnTheTrueLines) {
  const std::vector<Segment3> lines = RoomLines();
  const Recording recording = Record(lines, Walk(12));
  const auto lifted = recording.Lift();
  std::vector<double> errors;
  for (size_t v = 0; v < lifted.size(); ++v) {
    uint32_t next_source = 0;
    for (const TriangulatedSegment& segment : lifted[v]) {
      errors.push_back(ErrorOf(segment, lines));
      ASSERT_GE(segment.source, next_source);
      next_source = segment.source + 1;
      ASSERT_LT(segment.source, recording.segments[v].size());
      // On the rays of the ends, at the given depths.
      const Segment2& source = recording.segments[v][segment.source];
      const Segment3& in_world = segment.segment_in_world;
      const Eigen::Vector3d start = recording.poses[v] * in_world.start;
      const Eigen::Vector3d end = recording.poses[v] * in_world.end;
      EXPECT_LT((RoomCamera().Project(start) - source.start).norm(), 1e-6);
      EXPECT_LT((RoomCamera().Project(end) - source.end).norm(), 1e-6);
      EXPECT_NEAR(start.z(), segment.depth_m[0], 1e-9);
      EXPECT_NEAR(end.z(), segment.depth_m[1], 1e-9);
      EXPECT_GT(segment.sigma_m[0], 0.0);
      EXPECT_GT(segment.sigma_m[1], 0.0);
    }
  }
  size_t num_segments = 0;
  for (const auto& segments : recording.segments) num_segments += segments.size();
  ASSERT_GT(errors.size(), num_segments * 3 / 10);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.02);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.2);
}

TEST(Triangulation, EqualInputsGiveEqualLines) {
  const Recording recording = Record(RoomLines(), Walk(6));
  const auto a = recording.Lift(), b = recording.Lift();
  ASSERT_EQ(Count(a), Count(b));
  for (size_t v = 0; v < a.size(); ++v) {
    for (size_t i = 0; i < a[v].size(); ++i) {
      EXPECT_EQ(a[v][i].segment_in_world.start, b[v][i].segment_in_world.start);
    }
  }
}

TEST(Triangulation, PureRotationLiftsNothing) {
  std::vector<Rigid3> poses;
  for (int k = 0; k < 8; ++k) {
    poses.push_back(LookAlong({-0.5, 0.0, 0.0}, {1.0, 0.08 * k - 0.3, 0.0}));
  }
  EXPECT_EQ(Count(Record(RoomLines(), poses).Lift()), 0u);
  // Neither when the centres' differences are those of inexact poses.
  Random random(3);
  for (Rigid3& pose : poses) pose = testing::Disturb(pose, 0.001, 0.0, &random);
  EXPECT_EQ(Count(Record(RoomLines(), poses).Lift()), 0u);
}

TEST(Triangulation, MotionAlongTheLinesLiftsOnlyTheOthers) {
  std::vector<Segment3> along, across;
  for (int k = 0; k < 12; ++k) {
    along.push_back({{3.0 - 0.1 * k, -2.0, -1.1 + 0.2 * k}, {3.0 - 0.1 * k, 2.0, -1.1 + 0.2 * k}});
    across.push_back(
        {{2.5 + 0.05 * k, -1.5 + 0.27 * k, -1.0}, {2.5 + 0.05 * k, -1.5 + 0.27 * k, 1.0}});
  }
  std::vector<Rigid3> poses;
  for (int k = 0; k < 9; ++k) poses.push_back(LookAlong({0.0, 0.2 * k - 0.8, 0.0}, {1, 0, 0}));
  RenderOptions options;
  options.missing_share = options.fragment_share = 0.0;
  options.num_clutter = 0;
  EXPECT_EQ(Count(Record(along, poses, options).Lift()), 0u);

  std::vector<Segment3> both = along;
  both.insert(both.end(), across.begin(), across.end());
  const auto lifted = Record(both, poses, options).Lift();
  EXPECT_GT(Count(lifted), 9u * across.size() * 7 / 10);
  for (const auto& view : lifted) {
    for (const TriangulatedSegment& segment : view) EXPECT_LT(ErrorOf(segment, across), 0.05);
  }
}

TEST(Triangulation, TwoViewsAreNotEnough) {
  EXPECT_EQ(Count(Record(RoomLines(), {Walk(5)[1], Walk(5)[3]}).Lift()), 0u);
}

TEST(Triangulation, SegmentsOfNothingRarelyAgree) {
  RenderOptions clutter;
  clutter.num_clutter = 150;
  const Recording recording = Record({}, Walk(10), clutter);
  EXPECT_LT(Count(recording.Lift()), 30u);
}

TEST(Triangulation, UnusableSegmentsAreLeftOut) {
  Recording recording = Record(RoomLines(), Walk(5));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (auto& segments : recording.segments) {
    segments.push_back({{10.0, 10.0}, {10.0, 10.0}});
    segments.push_back({{nan, 10.0}, {100.0, 10.0}});
  }
  const auto lifted = recording.Lift();
  EXPECT_GT(Count(lifted), 0u);
  for (size_t v = 0; v < lifted.size(); ++v) {
    for (const TriangulatedSegment& segment : lifted[v]) {
      EXPECT_GE(recording.segments[v][segment.source].Length(), 12.0);
    }
  }
}

TEST(ViewNeighbours, AreNearSpacedAndLookTheSameWay) {
  std::vector<Rigid3> poses;
  for (int k = 0; k < 40; ++k) poses.push_back(LookAlong({0.0, 0.01 * k, 0.0}, {1, 0, 0}));
  poses.push_back(LookAlong({0.0, 0.05, 0.0}, {0, 1, 0}));  // 40: looks elsewhere
  poses.push_back(poses[0]);                                // 41: the same centre
  const std::vector<uint32_t> neighbours = ViewNeighbours(poses, 0);
  ASSERT_FALSE(neighbours.empty());
  EXPECT_EQ(neighbours.front(), 1u);
  EXPECT_GT(neighbours.back(), 25u);
  EXPECT_LT(neighbours.size(), 20u);
  EXPECT_EQ(std::count(neighbours.begin(), neighbours.end(), 40u), 0);
  EXPECT_EQ(std::count(neighbours.begin(), neighbours.end(), 41u), 0);
  ViewNeighbourOptions few;
  few.max_neighbours = 3;
  EXPECT_EQ(ViewNeighbours(poses, 0, few).size(), 3u);
}

}  // namespace
}  // namespace plumb
