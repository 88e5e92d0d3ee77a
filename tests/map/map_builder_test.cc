// Maps built from synthetic posed RGB-D frames of a room with drawn lines.
#include "plumb/map/map_builder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "map/rendered_depth.h"
#include "plumb/geometry/line_projection.h"
#include "plumb/map/map_check.h"

namespace plumb {
namespace {

constexpr Camera kCamera{260.0, 262.0, 159.5, 119.5, 320, 240};
const double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Scene {
  std::vector<Patch> patches;
  std::vector<Segment3> lines;
};

// A wall at z = 3 m and a slanted board in front of it. Lines 0 and 1 are parallel, 3 cm apart.
Scene Room() {
  Scene scene;
  scene.patches = {{{-4, -3, 3}, {8, 0, 0}, {0, 6, 0}},
                   {{0.4, -0.6, 2.0}, {0.9, 0, 0.3}, {0, 1.2, 0}}};
  scene.lines = {{{-1.2, -0.4, 3}, {0.1, -0.4, 3}},        {{-1.2, -0.37, 3}, {0.1, -0.37, 3}},
                 {{-1.0, 0.9, 3}, {-0.2, -0.1, 3}},        {{-0.9, -0.9, 3}, {-0.9, 0.6, 3}},
                 {{0.4, -0.6, 2.0}, {0.4, 0.6, 2.0}},         // the board's edge
                 {{0.5, -0.4, 2.0333}, {1.1, 0.4, 2.2333}}};  // drawn on it
  return scene;
}

std::vector<Rigid3> Path(int count) {
  std::vector<Rigid3> poses;
  for (int k = 0; k < count; ++k) {
    const double s = count > 1 ? 2.0 * k / (count - 1) - 1.0 : 0.0;  // -1 .. 1
    const Rigid3 world_from_cam{ExpSo3({0.03 * s, -0.12 * s, 0.05 * s}),
                                {0.5 * s, 0.1 * s, 0.1 * s}};
    poses.push_back(world_from_cam.Inverse());
  }
  return poses;
}

struct Recording {
  std::vector<DepthImage> depth;
  std::vector<std::vector<Segment2>> segments;
  std::vector<KeyFrameInput> frames;
};

Recording Record(const Scene& scene, const std::vector<Rigid3>& poses, double noise_px,
                 const Camera& camera = kCamera) {
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  Recording recording;
  for (const Rigid3& pose : poses) {
    recording.depth.push_back(RenderDepth(camera, pose, scene.patches));
    std::vector<Segment2>& segments = recording.segments.emplace_back();
    for (const Segment3& line : scene.lines) {
      auto segment = ProjectSegment(camera, pose, line);
      if (!segment) continue;
      for (Eigen::Vector2d* end : {&segment->start, &segment->end}) {
        *end += noise_px * Eigen::Vector2d(normal(random), normal(random));
      }
      segments.push_back(*segment);
    }
  }
  for (size_t k = 0; k < poses.size(); ++k) {
    KeyFrameInput& frame = recording.frames.emplace_back();
    frame.timestamp_ns = 1000 + static_cast<int64_t>(k);
    frame.cam_from_world = poses[k];
    frame.camera = camera;
    frame.segments = recording.segments[k];
    frame.depth = recording.depth[k].View();
  }
  return recording;
}

LineMap BuildMap(const Recording& recording, const MapBuilderOptions& options = {}) {
  MapBuilder builder(options);
  for (const KeyFrameInput& frame : recording.frames) {
    const Status added = builder.AddKeyFrame(frame);
    EXPECT_TRUE(added.has_value()) << added.error().message;
  }
  Result<LineMap> map = builder.Build();
  EXPECT_TRUE(map.has_value());
  return std::move(*map);
}

double DistanceFromLine(const Segment3& line, const Eigen::Vector3d& x) {
  return line.Delta().normalized().cross(x - line.start).norm();
}

// The map line that lies on a line of the scene, if exactly one does.
const MapLine* Find(const LineMap& map, const Segment3& truth, double tolerance_m) {
  const MapLine* found = nullptr;
  for (const MapLine& line : map.lines) {
    if (DistanceFromLine(truth, line.segment_in_world.start) > tolerance_m ||
        DistanceFromLine(truth, line.segment_in_world.end) > tolerance_m) {
      continue;
    }
    if (found != nullptr) return nullptr;
    found = &line;
  }
  return found;
}

void ExpectConsistent(const LineMap& map) {
  ASSERT_EQ(map.sighting_begin.size(), map.lines.size() + 1);
  ASSERT_EQ(map.sighting_begin.back(), map.sightings.size());
  for (uint32_t i = 0; i < map.lines.size(); ++i) {
    const MapLine& line = map.lines[i];
    const auto sightings = map.SightingsOf(i);
    EXPECT_EQ(sightings.size(), line.num_observing);
    EXPECT_GE(line.num_expected, line.num_observing);
    EXPECT_LE(line.num_expected, map.key_frames.size());
    for (size_t k = 0; k < sightings.size(); ++k) {
      if (k > 0) {
        EXPECT_LT(sightings[k - 1].key_frame, sightings[k].key_frame);
      }
      const KeyFrame& frame = map.key_frames[sightings[k].key_frame];
      EXPECT_TRUE(std::any_of(frame.segments.begin(), frame.segments.end(),
                              [i](const LiftedSegment& s) { return s.line == i; }));
      const Eigen::Vector3d camera =
          line.segment_in_world.Midpoint() +
          sightings[k].distance_m * sightings[k].direction_to_camera.cast<double>();
      EXPECT_LT((camera - frame.cam_from_world.Center()).norm(), 1e-5);
      EXPECT_NEAR(sightings[k].direction_to_camera.norm(), 1.0f, 1e-5f);
    }
  }
  const Status checked = CheckMap(map);
  EXPECT_TRUE(checked) << checked.error().message;
  for (const KeyFrame& frame : map.key_frames) {
    for (const LiftedSegment& segment : frame.segments) {
      EXPECT_TRUE(!segment.line || *segment.line < map.lines.size());
    }
  }
}

TEST(MapBuilder, FusesEachLineOverAllViews) {
  const Scene scene = Room();
  const LineMap map = BuildMap(Record(scene, Path(7), 0.3));
  EXPECT_EQ(map.lines.size(), scene.lines.size());
  for (const Segment3& truth : scene.lines) {
    const MapLine* line = Find(map, truth, 0.01);
    ASSERT_NE(line, nullptr);
    EXPECT_EQ(line->num_observing, 7u);
    EXPECT_EQ(line->num_expected, 7u);
    EXPECT_GT(line->segment_in_world.Length(), 0.8 * truth.Length());
    EXPECT_LT(line->segment_in_world.Length(), 1.1 * truth.Length());
  }
  ExpectConsistent(map);
}

TEST(MapBuilder, ParallelLinesThreeCentimetresApartStayApart) {
  const Scene scene = Room();
  const LineMap map = BuildMap(Record(scene, Path(7), 0.3));
  const MapLine* upper = Find(map, scene.lines[0], 0.008);
  const MapLine* lower = Find(map, scene.lines[1], 0.008);
  ASSERT_NE(upper, nullptr);
  ASSERT_NE(lower, nullptr);
  EXPECT_NEAR(lower->segment_in_world.Midpoint().y() - upper->segment_in_world.Midpoint().y(), 0.03,
              0.005);
}

TEST(MapBuilder, FragmentsOfOneFrameJoinTheSameLine) {
  Recording recording = Record(Room(), Path(5), 0.0);
  const Segment2 whole = recording.segments[2][3];
  recording.segments[2][3] = {whole.start, whole.start + 0.45 * whole.Delta()};
  recording.segments[2].push_back({whole.start + 0.55 * whole.Delta(), whole.end});
  recording.frames[2].segments = recording.segments[2];
  const LineMap map = BuildMap(recording);
  EXPECT_EQ(map.lines.size(), Room().lines.size());
  ASSERT_EQ(map.key_frames[2].segments.size(), 7u);
  ASSERT_TRUE(map.key_frames[2].segments[3].line);
  EXPECT_EQ(map.key_frames[2].segments[3].line, map.key_frames[2].segments[6].line);
  EXPECT_EQ(map.lines[*map.key_frames[2].segments[3].line].num_observing, 5u);
  ExpectConsistent(map);
}

TEST(MapBuilder, ALineThatAFrameMissesIsExpectedThere) {
  Recording recording = Record(Room(), Path(5), 0.0);
  recording.segments[1].erase(recording.segments[1].begin() + 2);
  recording.frames[1].segments = recording.segments[1];
  const LineMap map = BuildMap(recording);
  const MapLine* line = Find(map, Room().lines[2], 0.01);
  ASSERT_NE(line, nullptr);
  EXPECT_EQ(line->num_observing, 4u);
  EXPECT_EQ(line->num_expected, 5u);
  ExpectConsistent(map);
}

TEST(MapBuilder, LinesOfOneViewAreKept) {
  const LineMap map = BuildMap(Record(Room(), Path(1), 0.0));
  EXPECT_EQ(map.lines.size(), Room().lines.size());
  for (const MapLine& line : map.lines) EXPECT_EQ(line.num_observing, 1u);
  ExpectConsistent(map);
}

TEST(MapBuilder, ErrorsAreAsLargeAsTheCovarianceSays) {
  const Scene scene = Room();
  const LineMap map = BuildMap(Record(scene, Path(9), 0.7));
  for (const Segment3& truth : scene.lines) {
    const MapLine* line = Find(map, truth, 0.02);
    ASSERT_NE(line, nullptr);
    const double sigma = std::sqrt(line->covariance_start.trace());
    EXPECT_GT(sigma, 1e-4);
    EXPECT_LT(sigma, 2e-2);  // one view alone: 4e-2
    EXPECT_LT(DistanceFromLine(truth, line->segment_in_world.start), 4.0 * sigma);
  }
}

TEST(MapBuilder, MirroredCameraGivesTheSameLines) {
  Camera mirrored = kCamera;
  mirrored.fy = -mirrored.fy;
  const Scene scene = Room();
  const LineMap map = BuildMap(Record(scene, Path(5), 0.2, mirrored));
  for (const Segment3& truth : scene.lines) EXPECT_NE(Find(map, truth, 0.01), nullptr);
}

TEST(MapBuilder, FilterRejectsAnObservationAtTheWrongPlace) {
  Recording recording = Record(Room(), Path(7), 0.2);
  // Near enough to be associated while lines are young, too far for the other views to agree.
  recording.segments[3][3].start.x() += 2.2;
  recording.segments[3][3].end.x() += 2.2;
  MapBuilderOptions off, on;
  off.pnp_filter.enabled = false;
  on.pnp_filter.enabled = true;
  on.pnp_filter.threshold_px = 1.5;
  on.pnp_filter.min_inliers = 6;
  const LineMap without = BuildMap(recording, off), with = BuildMap(recording, on);
  ASSERT_EQ(without.key_frames[3].segments.size(), with.key_frames[3].segments.size());
  EXPECT_TRUE(without.key_frames[3].segments[3].line);
  EXPECT_FALSE(with.key_frames[3].segments[3].line);
  ExpectConsistent(with);
}

TEST(MapBuilder, EqualInputsGiveEqualMaps) {
  const Recording recording = Record(Room(), Path(6), 0.5);
  const LineMap a = BuildMap(recording), b = BuildMap(recording);
  ASSERT_EQ(a.lines.size(), b.lines.size());
  for (size_t i = 0; i < a.lines.size(); ++i) {
    EXPECT_EQ(a.lines[i].segment_in_world.start, b.lines[i].segment_in_world.start);
    EXPECT_EQ(a.lines[i].segment_in_world.end, b.lines[i].segment_in_world.end);
    EXPECT_EQ(a.lines[i].covariance_start, b.lines[i].covariance_start);
  }
}

TEST(MapBuilder, BuildsAgainAfterMoreFrames) {
  const Recording recording = Record(Room(), Path(6), 0.3);
  MapBuilder builder;
  for (size_t k = 0; k < 3; ++k) ASSERT_TRUE(builder.AddKeyFrame(recording.frames[k]).has_value());
  ASSERT_TRUE(builder.Build().has_value());
  for (size_t k = 3; k < 6; ++k) ASSERT_TRUE(builder.AddKeyFrame(recording.frames[k]).has_value());
  const Result<LineMap> map = builder.Build();
  ASSERT_TRUE(map.has_value());
  EXPECT_EQ(map->key_frames.size(), 6u);
  EXPECT_EQ(map->lines.size(), Room().lines.size());
  EXPECT_EQ(builder.stats().num_key_frames, 6u);
  EXPECT_EQ(builder.stats().num_segments, 36u);
  EXPECT_EQ(builder.stats().num_lifted, 36u);
  EXPECT_EQ(builder.stats().num_multi_view_lines, 6u);
}

TEST(MapBuilder, MovedPosesTakeAllThatTheirFramesHoldAlong) {
  Recording recording = Record(Room(), Path(4), 0.2);
  for (KeyFrameInput& frame : recording.frames) {
    frame.points.resize(1);
    frame.points[0].point_in_world = {0.1f, 0.2f, 3.0f};
  }
  MapBuilderOptions options;
  options.depth_source = DepthSource::kSensor;  // triangulation iterates: equal to 2e-6 only
  MapBuilder builder(options);
  for (const KeyFrameInput& frame : recording.frames) {
    ASSERT_TRUE(builder.AddKeyFrame(frame).has_value());
  }
  const Result<LineMap> before = builder.Build();
  ASSERT_TRUE(before.has_value());
  const Rigid3 new_from_old{ExpSo3({0.1, 0.2, -0.3}), {1.0, -2.0, 0.5}};
  std::vector<Rigid3> poses;
  for (const KeyFrame& frame : before->key_frames) {
    poses.push_back(frame.cam_from_world * new_from_old.Inverse());
  }
  ASSERT_TRUE(builder.SetPoses(poses).has_value());
  const Result<LineMap> after = builder.Build();
  ASSERT_TRUE(after.has_value());
  ASSERT_EQ(after->lines.size(), before->lines.size());
  for (size_t i = 0; i < after->lines.size(); ++i) {
    const Segment3& old = before->lines[i].segment_in_world;
    const Segment3& now = after->lines[i].segment_in_world;
    EXPECT_LT((new_from_old * old.start - now.start).norm(), 1e-6);
    EXPECT_LT((new_from_old * old.end - now.end).norm(), 1e-6);
  }
  const Eigen::Vector3d point = after->key_frames[2].points[0].point_in_world.cast<double>();
  EXPECT_LT((new_from_old * Eigen::Vector3d(0.1, 0.2, 3.0) - point).norm(), 1e-5);

  poses.pop_back();
  EXPECT_FALSE(builder.SetPoses(poses).has_value());
  poses.push_back({Eigen::Quaterniond(2.0, 0.0, 0.0, 0.0), Eigen::Vector3d::Zero()});
  EXPECT_FALSE(builder.SetPoses(poses).has_value());
}

MapBuilderOptions WithoutDepth() {
  MapBuilderOptions options;
  options.depth_source = DepthSource::kViews;
  return options;
}

TEST(MapBuilderWithoutDepth, FusesEachLineThatTheMotionTells) {
  const Scene scene = Room();
  Recording recording = Record(scene, Path(9), 0.3);
  for (KeyFrameInput& frame : recording.frames) frame.depth = {};
  const LineMap map = BuildMap(recording, WithoutDepth());
  EXPECT_EQ(map.depth_source, DepthSource::kViews);
  // Lines 0 and 1 are nearly parallel to the path.
  for (const size_t i : {2u, 3u, 4u, 5u}) {
    const MapLine* line = Find(map, scene.lines[i], 0.02);
    ASSERT_NE(line, nullptr) << i;
    EXPECT_GE(line->num_observing, 3u);
    EXPECT_GT(line->segment_in_world.Length(), 0.8 * scene.lines[i].Length());
    EXPECT_LT(line->segment_in_world.Length(), 1.1 * scene.lines[i].Length());
    const double sigma = std::sqrt(line->covariance_start.trace());
    EXPECT_LT(DistanceFromLine(scene.lines[i], line->segment_in_world.start), 4.0 * sigma);
  }
  for (const MapLine& line : map.lines) EXPECT_GE(line.num_observing, 3u);
  ExpectConsistent(map);
}

TEST(MapBuilderWithoutDepth, OneViewOrOnePlaceGivesNoLines) {
  for (const size_t count : {1u, 2u, 7u}) {
    std::vector<Rigid3> poses(count, Path(5)[2]);
    for (size_t k = 0; k < count; ++k) {
      const Eigen::Quaterniond turn = ExpSo3({0.0, 0.04 * static_cast<double>(k), 0.0});
      poses[k] = Rigid3{turn, Eigen::Vector3d::Zero()} * poses[k];
    }
    const LineMap map = BuildMap(Record(Room(), poses, 0.3), WithoutDepth());
    EXPECT_TRUE(map.lines.empty());
    EXPECT_EQ(map.key_frames.size(), count);
    ExpectConsistent(map);
  }
}

TEST(MapBuilderWithoutDepth, BuildsAgainAfterMoreFrames) {
  const Recording recording = Record(Room(), Path(9), 0.3);
  MapBuilder builder(WithoutDepth());
  std::vector<double> progress;
  for (size_t k = 0; k < recording.frames.size(); ++k) {
    ASSERT_TRUE(builder.AddKeyFrame(recording.frames[k]).has_value());
    progress.clear();
    ASSERT_TRUE(builder.Build([&progress](double done) { progress.push_back(done); }).has_value());
    EXPECT_TRUE(std::is_sorted(progress.begin(), progress.end()));
    EXPECT_EQ(progress.back(), 1.0);
  }
  const LineMap at_once = BuildMap(recording, WithoutDepth());
  EXPECT_EQ(builder.stats().num_lines, at_once.lines.size());
  EXPECT_EQ(builder.stats().num_segments, 9 * Room().lines.size());
}

// Twenty lines drawn on the wall and ten on the board, in many directions.
Scene DrawnRoom() {
  Scene scene = Room();
  for (int k = 0; k < 20; ++k) {
    const Eigen::Vector3d middle(-1.3 + 0.14 * k, -0.9 + 0.4 * (k % 5), 3.0);
    const Eigen::Vector3d half(0.25 * std::cos(0.7 * k), 0.25 * std::sin(0.7 * k), 0.0);
    scene.lines.push_back({middle - half, middle + half});
  }
  for (int k = 0; k < 10; ++k) {
    const auto on_board = [](double a, double b) {
      return Eigen::Vector3d(0.4 + 0.9 * a, -0.6 + 1.2 * b, 2.0 + 0.3 * a);
    };
    scene.lines.push_back({on_board(0.1 + 0.08 * k, 0.1), on_board(0.9 - 0.06 * k, 0.9)});
  }
  return scene;
}

// Records with a depth sensor that is off by up to 5 % in the corners and 2 % in the middle.
Recording RecordWarped(const Scene& scene, const std::vector<Rigid3>& poses) {
  Recording recording = Record(scene, poses, 0.2);
  for (size_t k = 0; k < poses.size(); ++k) {
    DepthImage& depth = recording.depth[k];
    for (int y = 0; y < depth.height_px; ++y) {
      for (int x = 0; x < depth.width_px; ++x) {
        depth.at(x, y) *= static_cast<float>(1.02 + 1e-4 * (x - 160) - 1e-4 * (y - 120));
      }
    }
    recording.frames[k].depth = depth.View();
  }
  return recording;
}

double MedianError(const LineMap& map, const Scene& scene) {
  std::vector<double> errors;
  for (const KeyFrame& frame : map.key_frames) {
    for (const LiftedSegment& segment : frame.segments) {
      double least = 1e9;
      for (const Segment3& line : scene.lines) {
        least = std::min(least, std::max(DistanceFromLine(line, segment.segment_in_world.start),
                                         DistanceFromLine(line, segment.segment_in_world.end)));
      }
      errors.push_back(least);
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors.empty() ? 1e9 : errors[errors.size() / 2];
}

TEST(MapBuilderWithBoth, ViewsCorrectAWarpedSensor) {
  const Scene scene = DrawnRoom();
  Recording recording = RecordWarped(scene, Path(12));
  for (size_t k = 0; k < recording.frames.size(); ++k) {
    MapPoint& point = recording.frames[k].points.emplace_back();  // at (0, 0, 3) of the wall
    const Eigen::Vector3d in_cam = recording.frames[k].cam_from_world * Eigen::Vector3d(0, 0, 3);
    const Eigen::Vector2d px = kCamera.Project(in_cam);
    const double warped = 1.02 + 1e-4 * (px.x() - 160) - 1e-4 * (px.y() - 120);
    point.pixel = px.cast<float>();
    point.point_in_world =
        (recording.frames[k].cam_from_world.Inverse() * Eigen::Vector3d(warped * in_cam))
            .cast<float>();
  }
  MapBuilderOptions options;
  MapBuilder builder(options);
  for (const KeyFrameInput& frame : recording.frames) ASSERT_TRUE(builder.AddKeyFrame(frame));
  const Result<LineMap> both = builder.Build();
  ASSERT_TRUE(both);
  EXPECT_EQ(both->depth_source, DepthSource::kBoth);
  options.depth_source = DepthSource::kSensor;
  const LineMap sensor = BuildMap(recording, options);

  EXPECT_GT(MedianError(sensor, scene), 0.04);
  EXPECT_LT(MedianError(*both, scene), 0.01);  // views alone: 0.2 px at 3 m
  EXPECT_NEAR(builder.stats().depth_change, 0.02, 0.01);
  EXPECT_GT(builder.stats().num_averaged, 100u);
  // Apart, frames have the corrected depth of their own image: exact but for the correction's
  // noise, and the same whatever other frames' segments say of a single line.
  const std::vector<KeyFrame> apart = builder.KeyFramesApart();
  ASSERT_EQ(apart.size(), recording.frames.size());
  LineMap apart_map;
  apart_map.key_frames = apart;
  EXPECT_LT(MedianError(apart_map, scene), 0.01);
  ASSERT_EQ(apart[3].segments.size(), both->key_frames[3].segments.size());
  EXPECT_NE(apart[3].segments[5].segment_in_world.start,
            both->key_frames[3].segments[5].segment_in_world.start);
  EXPECT_TRUE(apart[3].points.empty());
  for (const KeyFrame& frame : both->key_frames) {
    EXPECT_LT((frame.points[0].point_in_world - Eigen::Vector3f(0, 0, 3)).norm(), 0.01f);
  }
  ExpectConsistent(*both);
}

TEST(MapBuilderWithBoth, TooFewViewsLeaveTheSensorsDepth) {
  const Recording recording = RecordWarped(Room(), Path(2));
  MapBuilderOptions options;
  const LineMap both = BuildMap(recording, options);
  options.depth_source = DepthSource::kSensor;
  const LineMap sensor = BuildMap(recording, options);
  ASSERT_EQ(both.lines.size(), sensor.lines.size());
  for (size_t i = 0; i < both.lines.size(); ++i) {
    EXPECT_EQ(both.lines[i].segment_in_world.start, sensor.lines[i].segment_in_world.start);
  }
}

TEST(MapBuilderWithBoth, WithoutDepthTheViewsLift) {
  Recording recording = Record(DrawnRoom(), Path(12), 0.2);
  for (size_t k = 0; k < recording.frames.size(); ++k) {
    DepthImage& depth = recording.depth[k];
    for (int y = 0; y < depth.height_px; ++y) {
      for (int x = 0; x < depth.width_px; ++x) depth.at(x, y) = 0.0f;  // nothing measured
    }
    recording.frames[k].depth = depth.View();
  }
  MapBuilderOptions options;
  options.depth_source = DepthSource::kViews;
  const LineMap views = BuildMap(recording, options);
  options.depth_source = DepthSource::kBoth;
  const LineMap both = BuildMap(recording, options);
  ASSERT_GT(views.lines.size(), 20u);
  for (size_t k = 0; k < views.key_frames.size(); ++k) {
    EXPECT_EQ(both.key_frames[k].segments.size(), views.key_frames[k].segments.size());
  }
  EXPECT_LT(MedianError(both, DrawnRoom()), 0.03);
  EXPECT_GT(both.lines.size(), 20u);
  // Nothing to calibrate on but the map itself.
  MapBuilder builder(options);
  for (const KeyFrameInput& frame : recording.frames) ASSERT_TRUE(builder.AddKeyFrame(frame));
  ASSERT_TRUE(builder.Build());
  EXPECT_TRUE(builder.KeyFramesApart().empty());
}

TEST(MapBuilder, KeepsWhatTheCallerAttaches) {
  Recording recording = Record(Room(), Path(2), 0.0);
  recording.frames[1].points.resize(3);
  recording.frames[1].points[2].pixel = {4.0f, 5.0f};
  MapBuilderOptions options;
  options.detector = "lsd";
  const LineMap map = BuildMap(recording, options);
  EXPECT_EQ(map.detector, "lsd");
  EXPECT_TRUE(map.key_frames[0].points.empty());
  ASSERT_EQ(map.key_frames[1].points.size(), 3u);
  EXPECT_EQ(map.key_frames[1].points[2].pixel.y(), 5.0f);
  EXPECT_EQ(map.key_frames[1].timestamp_ns, 1001);
}

TEST(MapBuilder, ProgressAscendsToOne) {
  const Recording recording = Record(Room(), Path(4), 0.0);
  MapBuilder builder;
  for (const KeyFrameInput& frame : recording.frames) {
    ASSERT_TRUE(builder.AddKeyFrame(frame).has_value());
  }
  std::vector<double> progress;
  ASSERT_TRUE(builder.Build([&progress](double done) { progress.push_back(done); }).has_value());
  ASSERT_GT(progress.size(), 4u);
  EXPECT_TRUE(std::is_sorted(progress.begin(), progress.end()));
  EXPECT_GE(progress.front(), 0.0);
  EXPECT_EQ(progress.back(), 1.0);
}

TEST(MapBuilder, FramesWithoutSegmentsAreFine) {
  Recording recording = Record(Room(), Path(3), 0.0);
  for (KeyFrameInput& frame : recording.frames) frame.segments = {};
  const LineMap map = BuildMap(recording);
  EXPECT_TRUE(map.lines.empty());
  EXPECT_EQ(map.key_frames.size(), 3u);
  ExpectConsistent(map);
}

TEST(MapBuilder, RefusesABrokenFrameByName) {
  const Recording recording = Record(Room(), Path(1), 0.0);
  MapBuilder builder;
  const auto message = [&](auto change) {
    KeyFrameInput frame = recording.frames[0];
    change(frame);
    const Status status = builder.AddKeyFrame(frame);
    if (status.has_value()) return std::string("accepted");
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(status.error().message.find("1000 ns"), std::string::npos) << status.error().message;
    return status.error().message;
  };
  using F = KeyFrameInput;
  const auto has = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_TRUE(has(message([](F& f) { f.cam_from_world.translation.x() = kNaN; }), "pose"));
  EXPECT_TRUE(has(message([](F& f) { f.cam_from_world.rotation.w() = kNaN; }), "pose"));
  EXPECT_TRUE(has(message([](F& f) { f.cam_from_world.rotation.coeffs() *= 2.0; }), "quaternion"));
  EXPECT_TRUE(has(message([](F& f) { f.camera.fx = 0.0; }), "intrinsics"));
  EXPECT_TRUE(has(message([](F& f) { f.depth = {}; }), "no data"));
  EXPECT_TRUE(has(message([](F& f) { f.camera.width_px = 640; }), "320 x 240 px, the camera 640"));
  EXPECT_EQ(builder.stats().num_key_frames, 0u);

  EXPECT_EQ(message([](F&) {}), "accepted");
  EXPECT_TRUE(has(message([](F&) {}), "added before"));
  EXPECT_EQ(builder.stats().num_key_frames, 1u);
}

TEST(MapBuilder, RefusesToBuildWithoutFrames) {
  const Result<LineMap> map = MapBuilder().Build();
  ASSERT_FALSE(map.has_value());
  EXPECT_EQ(map.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace plumb
