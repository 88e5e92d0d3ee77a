// Key frames of a synthetic room whose poses are noisy, through map builder and adjustment.
#include "plumb/runtime/pose_adjustment.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "map/rendered_depth.h"
#include "plumb/map/map_builder.h"
#include "support/synthetic_room.h"

namespace plumb {
namespace {

constexpr Camera kCamera{525.0, 525.0, 319.5, 239.5, 640, 480};
constexpr double kPositionSigmaM = 0.005, kRotationSigmaRad = 0.1 * std::numbers::pi / 180.0;
constexpr double kNoisePx = 0.3;

// From inside a box of 6 x 5 x 2.6 m.
DepthImage RenderBox(const Rigid3& cam_from_world) {
  const Eigen::Vector3d half(3.0, 2.5, 1.3), center = cam_from_world.Center();
  const Eigen::Matrix3d world_from_cam = cam_from_world.RotationMatrix().transpose();
  return MakeDepth(kCamera, [&](int x, int y) {
    const Eigen::Vector3d ray = world_from_cam * kCamera.Normalize({x, y}).homogeneous();
    double depth_m = 100.0;
    for (int i = 0; i < 3; ++i) {
      const double wall = ray[i] > 0.0 ? half[i] : -half[i];
      if (ray[i] != 0.0) depth_m = std::min(depth_m, (wall - center[i]) / ray[i]);
    }
    return depth_m;
  });
}

// Rectangles on the box's walls, floor and ceiling.
std::vector<Segment3> Pictures() {
  Random random(3);
  std::vector<Segment3> lines;
  const auto cover = [&](const Eigen::Vector3d& middle, const Eigen::Vector3d& along,
                         const Eigen::Vector3d& up, double reach_along, double reach_up) {
    for (double a = -reach_along; a < reach_along - 0.5; a += 0.65) {
      for (double b = -reach_up; b < reach_up - 0.5; b += 0.75) {
        testing::AppendRectangle(middle + a * along + b * up,
                                 testing::UniformIn(&random, 0.3, 0.5) * along,
                                 testing::UniformIn(&random, 0.3, 0.6) * up, &lines);
      }
    }
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  cover(3.0 * x, y, z, 2.4, 1.2);
  for (const double side : {-1.0, 1.0}) {
    cover(2.5 * side * y, x, z, 2.9, 1.2);
    cover(1.3 * side * z, x, y, 2.9, 2.4);
  }
  return lines;
}

struct Recording {
  explicit Recording(DepthSource source) : builder(Options(source)) {}

  static MapBuilderOptions Options(DepthSource source) {
    MapBuilderOptions options;
    options.depth_source = source;
    return options;
  }

  std::vector<Rigid3> truth, given;
  MapBuilder builder;
};

// The given poses are off by their deviations.
void Record(bool noisy, Recording* out) {
  const std::vector<Segment3> lines = Pictures();
  std::mt19937 rng(17);
  std::normal_distribution<double> normal;
  Random random(9);
  const std::vector<Rigid3> poses = testing::RoomSweep(36);
  for (size_t k = 0; k < poses.size(); ++k) {
    const Rigid3& pose = poses[k];
    const DepthImage depth = RenderBox(pose);
    std::vector<Segment2> segments;
    for (const Segment3& line : lines) {
      const auto part = testing::VisiblePart(kCamera, pose, line);
      if (!part) continue;
      Segment2 image{kCamera.Project(pose * part->start), kCamera.Project(pose * part->end)};
      for (Eigen::Vector2d* end : {&image.start, &image.end}) {
        *end += kNoisePx * Eigen::Vector2d(normal(rng), normal(rng));
      }
      segments.push_back(image);
    }
    KeyFrameInput frame;
    frame.timestamp_ns = static_cast<int64_t>(k);
    frame.cam_from_world = noisy ? testing::Disturb(pose, std::sqrt(3.0) * kPositionSigmaM,
                                                    std::sqrt(3.0) * kRotationSigmaRad, &random)
                                 : pose;
    frame.camera = kCamera;
    frame.segments = segments;
    frame.depth = depth.View();
    out->truth.push_back(pose);
    out->given.push_back(frame.cam_from_world);
    ASSERT_TRUE(out->builder.AddKeyFrame(frame));
  }
}

struct Adjusted {
  std::vector<Rigid3> poses;
  double before_px = 0.0, after_px = 0.0;
};

Adjusted Adjust(Recording* recording) {
  BundleOptions options;
  options.position_sigma_m = kPositionSigmaM;
  options.rotation_sigma_rad = kRotationSigmaRad;
  std::vector<double> progress;
  const Result<AdjustedMap> adjusted = BuildAdjustedMap(
      &recording->builder, options, [&progress](double done) { progress.push_back(done); });
  EXPECT_TRUE(adjusted);
  EXPECT_TRUE(std::is_sorted(progress.begin(), progress.end()));
  EXPECT_EQ(progress.back(), 1.0);
  Adjusted out{{}, adjusted->before_px, adjusted->after_px};
  for (const KeyFrame& frame : adjusted->map.key_frames) out.poses.push_back(frame.cam_from_world);
  const PoseChange change = MedianChange(recording->given, out.poses);
  EXPECT_NEAR(adjusted->map.pose_change->position_m, change.position_m, 1e-12);
  EXPECT_NEAR(adjusted->map.pose_change->rotation_rad, change.rotation_rad, 1e-12);
  return out;
}

class AdjustMapPosesWith : public ::testing::TestWithParam<DepthSource> {};

TEST_P(AdjustMapPosesWith, NoisyPosesComeBackThreeTimesNearer) {
  Recording recording(GetParam());
  Record(/*noisy=*/true, &recording);
  const PoseChange before = MedianChange(recording.truth, recording.given);
  const Adjusted adjusted = Adjust(&recording);
  const PoseChange after = MedianChange(recording.truth, adjusted.poses);
  EXPECT_GT(before.position_m, kPositionSigmaM);
  EXPECT_LT(after.position_m, before.position_m / 3.0);
  EXPECT_LT(after.rotation_rad, before.rotation_rad / 3.0);
  EXPECT_LT(adjusted.after_px, 0.5 * adjusted.before_px);
}

// Lifted ends take part with the sensor's own depth only.
INSTANTIATE_TEST_SUITE_P(DepthSources, AdjustMapPosesWith,
                         ::testing::Values(DepthSource::kSensor, DepthSource::kBoth));

TEST(AdjustMapPoses, ExactPosesStay) {
  Recording recording(DepthSource::kSensor);
  Record(/*noisy=*/false, &recording);
  const Adjusted adjusted = Adjust(&recording);
  const PoseChange change = MedianChange(recording.truth, adjusted.poses);
  EXPECT_LT(change.position_m, 0.4 * kPositionSigmaM);  // what the segments' noise allows
  EXPECT_LT(change.rotation_rad, 0.4 * kRotationSigmaRad);
}

TEST(AdjustMapPoses, NeedsALineOfTwoKeyFrames) {
  LineMap map = testing::MapOf(testing::RoomLines(), {testing::RoomKeyFrames()[0]});
  const std::vector<Rigid3> priors{map.key_frames[0].cam_from_world};
  EXPECT_FALSE(AdjustMapPoses(map, priors));
  map = testing::MapOf(testing::RoomLines(), testing::RoomKeyFrames());
  EXPECT_FALSE(AdjustMapPoses(map, priors));  // not one for each key frame
}

}  // namespace
}  // namespace plumb
