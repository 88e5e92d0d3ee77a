// The covariance factor of a map from frames that were left out of it.
#include "plumb/runtime/covariance_calibration.h"

#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/geometry/line_projection.h"
#include "support/wall_scene.h"

namespace plumb {
namespace {

const testing::WallScene kScene;

LineMap Map() {
  const std::vector<Rigid3> poses = testing::WallScene::KeyFramePoses();
  return kScene.MakeMap(poses);
}

// Frames between the key frames. `pose_error_m` puts the frame's stated pose beside the one that
// its segments were made at, as an error common to all its lines.
std::vector<HeldOutFrame> Frames(const LineMap& map, int count, double noise_px,
                                 double pose_error_m) {
  std::mt19937 random(23);
  std::normal_distribution<double> normal;
  std::vector<HeldOutFrame> frames;
  for (int k = 0; k < count; ++k) {
    const double a = 0.7 * k + 0.3;
    const Eigen::Vector3d center(0.2 * std::cos(a), 0.15 * std::sin(a), 0.1 * std::cos(2 * a));
    const Eigen::Quaterniond rotation = ExpSo3({0.03 * std::sin(a), 0.2, 0.02 * std::cos(a)});
    const Rigid3 cam_from_world{rotation, -(rotation * center)};
    HeldOutFrame frame;
    frame.camera = kScene.camera;
    for (const MapLine& line : map.lines) {
      std::optional<Segment2> segment =
          ProjectSegment(frame.camera, cam_from_world, line.segment_in_world);
      if (!segment || segment->Length() < 12.0) continue;
      for (Eigen::Vector2d* end : {&segment->start, &segment->end}) {
        *end += noise_px * Eigen::Vector2d(normal(random), normal(random));
      }
      frame.segments.push_back(*segment);
    }
    frame.cam_from_world = cam_from_world;
    frame.cam_from_world.translation +=
        pose_error_m * Eigen::Vector3d(normal(random), normal(random), normal(random));
    frames.push_back(frame);
  }
  return frames;
}

CovarianceCalibration Calibrate(const LineMap& map, const std::vector<HeldOutFrame>& frames) {
  const Result<CovarianceCalibration> calibration = CalibrateCovariance(map, frames, {});
  EXPECT_TRUE(calibration.has_value());
  return calibration ? *calibration : CovarianceCalibration();
}

TEST(CovarianceCalibration, IndependentNoiseNeedsNoLargeFactor) {
  const LineMap map = Map();
  const CovarianceCalibration calibration = Calibrate(map, Frames(map, 15, 0.5, 0.0));
  EXPECT_GE(calibration.num_refined, 12u);
  EXPECT_GT(calibration.factor, 0.1);
  EXPECT_LT(calibration.factor, 5.0);
}

TEST(CovarianceCalibration, CommonErrorsRaiseTheFactor) {
  const LineMap map = Map();
  const double independent = Calibrate(map, Frames(map, 15, 0.5, 0.0)).factor;
  const double common = Calibrate(map, Frames(map, 15, 0.5, 0.01)).factor;
  EXPECT_GT(common, 3.0 * independent);
}

TEST(CovarianceCalibration, TheMapsOwnFactorIsTakenIntoAccount) {
  LineMap map = Map();
  const std::vector<HeldOutFrame> frames = Frames(map, 15, 0.5, 0.01);
  const double factor = Calibrate(map, frames).factor;
  map.covariance_factor = factor;
  EXPECT_NEAR(Calibrate(map, frames).factor / factor, 1.0, 0.1);
}

TEST(CovarianceCalibration, Repeats) {
  const LineMap map = Map();
  const std::vector<HeldOutFrame> frames = Frames(map, 8, 0.5, 0.0);
  EXPECT_EQ(Calibrate(map, frames).factor, Calibrate(map, frames).factor);
}

TEST(CovarianceCalibration, TooFewFramesKeepTheMapsFactor) {
  LineMap map = Map();
  map.covariance_factor = 2.5;
  const CovarianceCalibration few = Calibrate(map, Frames(map, 4, 0.5, 0.01));
  EXPECT_LE(few.num_refined, 4u);
  EXPECT_EQ(few.factor, 2.5);
  EXPECT_EQ(Calibrate(map, {}).factor, 2.5);
}

TEST(CovarianceCalibration, RefusesABrokenFrame) {
  const LineMap map = Map();
  std::vector<HeldOutFrame> frames = Frames(map, 2, 0.5, 0.0);
  frames[1].cam_from_world.translation.x() = std::numeric_limits<double>::quiet_NaN();
  const auto calibration = CalibrateCovariance(map, frames, {});
  ASSERT_FALSE(calibration.has_value());
  EXPECT_EQ(calibration.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace plumb
