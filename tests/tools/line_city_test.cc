#include "tools/synth/line_city.h"

#include <gtest/gtest.h>

#include "plumb/geometry/line_projection.h"

namespace plumb::synth {
namespace {

TEST(LineCity, IsAConsistentMapOfTheWantedSize) {
  const LineCity city({.num_lines = 3000});
  const LineMap& map = city.map();
  EXPECT_EQ(map.lines.size(), 4000u);  // whole rooms
  EXPECT_EQ(map.key_frames.size(), 50u);
  ASSERT_EQ(map.sighting_begin.size(), map.lines.size() + 1);
  EXPECT_EQ(map.sighting_begin.back(), map.sightings.size());
  size_t num_lifted = 0;
  for (const KeyFrame& key_frame : map.key_frames) {
    num_lifted += key_frame.segments.size();
    for (const LiftedSegment& lifted : key_frame.segments) {
      ASSERT_LT(*lifted.line, map.lines.size());
      const Segment3& line = map.lines[*lifted.line].segment_in_world;
      EXPECT_LT((lifted.segment_in_world.start - line.start).norm(), 1.0);
    }
  }
  EXPECT_EQ(num_lifted, map.sightings.size());
  for (uint32_t i = 0; i < map.lines.size(); ++i) {
    EXPECT_EQ(map.SightingsOf(i).size(), map.lines[i].num_observing);
    EXPECT_LE(map.lines[i].num_observing, map.lines[i].num_expected);
  }
}

TEST(LineCity, FramesSeeTheMap) {
  const LineCity city({.num_lines = 2000});
  const Camera camera = LineCity::MakeCamera();
  Random random(1);
  for (int k = 0; k < 5; ++k) {
    const LineCity::Frame frame = city.MakeFrame(60, 50, &random);
    EXPECT_EQ(frame.segments.size(), 60u);
    EXPECT_EQ(frame.points.size(), 50u);
    int num_near = 0;
    for (const LineCity::Point& point : frame.points) {
      const Eigen::Vector3d x = frame.cam_from_world * point.point_in_world;
      num_near += x.z() > 0.1 && (camera.Project(x) - point.pixel).norm() < 15.0;
    }
    EXPECT_GE(num_near, 35);
    // All but the last sixth lie on a line of the map.
    for (size_t s = 0; s < 50; ++s) {
      double nearest = 1e9;
      for (const MapLine& line : city.map().lines) {
        const auto image = ProjectSegment(camera, frame.cam_from_world, line.segment_in_world);
        if (!image || image->Length() < 10.0) continue;
        const auto infinite =
            ProjectLine(camera, {frame.cam_from_world * line.segment_in_world.start,
                                 frame.cam_from_world * line.segment_in_world.end});
        if (!infinite) continue;
        nearest =
            std::min(nearest, std::max(std::abs(infinite->SignedDistance(frame.segments[s].start)),
                                       std::abs(infinite->SignedDistance(frame.segments[s].end))));
      }
      EXPECT_LT(nearest, 3.0);
    }
  }
}

TEST(LineCity, EqualSeedsGiveEqualMaps) {
  const LineCity a({.num_lines = 2000, .seed = 4}), b({.num_lines = 2000, .seed = 4});
  EXPECT_EQ(a.map().lines[1999].segment_in_world.start, b.map().lines[1999].segment_in_world.start);
  EXPECT_EQ(a.map().sightings.size(), b.map().sightings.size());
}

}  // namespace
}  // namespace plumb::synth
