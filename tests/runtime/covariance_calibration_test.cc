// The covariance of a map from what its own key frames show.
#include "plumb/runtime/covariance_calibration.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/runtime/covariance_factor.h"
#include "support/wall_scene.h"

namespace plumb {
namespace {

const testing::WallScene kScene;

/// Key frames on a line from the origin, `step_m` apart. Their segments are off by `noise_px` at
/// each end; their poses, and all that they lifted with them, by up to about `pose_error_m`.
LineMap Map(int num_key_frames, double step_m, double noise_px, double pose_error_m) {
  std::mt19937 random(23);
  std::normal_distribution<double> normal;
  std::vector<Rigid3> poses;
  for (int k = 0; k < num_key_frames; ++k) {
    const double a = 0.7 * k;
    const Eigen::Vector3d center(step_m * k - 0.2, 0.1 * std::sin(a), 0.05 * std::cos(2 * a));
    const Eigen::Quaterniond rotation = ExpSo3({0.03 * std::sin(a), 0.2, 0.02 * std::cos(a)});
    poses.push_back({rotation, -(rotation * center)});
  }
  LineMap map = kScene.MakeMap(poses);
  for (KeyFrame& key_frame : map.key_frames) {
    const Eigen::Vector3d shift =
        pose_error_m * Eigen::Vector3d(normal(random), normal(random), normal(random));
    key_frame.cam_from_world.translation -= key_frame.cam_from_world.rotation * shift;
    for (LiftedSegment& segment : key_frame.segments) {
      segment.segment_in_world.start += shift;
      segment.segment_in_world.end += shift;
      for (Eigen::Vector2d* end : {&segment.segment_px.start, &segment.segment_px.end}) {
        *end += noise_px * Eigen::Vector2d(normal(random), normal(random));
      }
    }
  }
  return map;
}

// A segment's noise counts once for every key frame whose line it meets, as if it were independent:
// hence about 2 instead of 1. Maps of real sequences need 17 to 75.
TEST(CovarianceCalibration, IndependentNoiseNeedsASmallFactor) {
  const CovarianceCalibration calibration = CalibrateCovariance(Map(12, 0.04, 0.5, 0.0));
  EXPECT_GE(calibration.num_errors, 50u);
  EXPECT_GT(calibration.factor + 0.2 * calibration.growth, 0.5);
  EXPECT_LT(calibration.factor + 0.2 * calibration.growth, 4.0);
}

TEST(CovarianceCalibration, ErrorsOfKeyFramesRaiseIt) {
  LineMap exact = Map(12, 0.04, 0.5, 0.0), off = Map(12, 0.04, 0.5, 0.01);
  const auto factor_at = [](LineMap* map, double distance) {
    const CovarianceCalibration calibration = CalibrateCovariance(*map);
    map->covariance_factor = calibration.factor;
    map->covariance_growth = calibration.growth;
    return CovarianceFactor(*map, distance);
  };
  EXPECT_GT(factor_at(&off, 0.15), 10.0 * factor_at(&exact, 0.15));
}

TEST(CovarianceCalibration, Repeats) {
  const LineMap map = Map(8, 0.04, 0.5, 0.005);
  const CovarianceCalibration a = CalibrateCovariance(map), b = CalibrateCovariance(map);
  EXPECT_EQ(a.factor, b.factor);
  EXPECT_EQ(a.growth, b.growth);
}

TEST(CovarianceCalibration, PerfectKeyFramesGiveASmallPositiveFactor) {
  const CovarianceCalibration calibration = CalibrateCovariance(Map(8, 0.04, 0.0, 0.0));
  EXPECT_GT(calibration.factor, 0.0);
  EXPECT_LT(calibration.factor, 0.1);
}

TEST(CovarianceCalibration, TooFewKeyFramesKeepTheMapsOwnValues) {
  LineMap map = Map(3, 0.04, 0.5, 0.01);
  map.covariance_factor = 2.5;
  map.covariance_growth = 7.0;
  const CovarianceCalibration calibration = CalibrateCovariance(map);
  EXPECT_EQ(calibration.num_errors, 0u);
  EXPECT_EQ(calibration.factor, 2.5);
  EXPECT_EQ(calibration.growth, 7.0);
  EXPECT_EQ(CalibrateCovariance(LineMap{}).factor, kUncalibratedFactor);
}

TEST(CovarianceFactor, GrowsWithTheDistanceUpToABound) {
  LineMap map;
  map.covariance_factor = 2.0;
  map.covariance_growth = 50.0;
  EXPECT_DOUBLE_EQ(CovarianceFactor(map, 0.0), 2.0);
  EXPECT_DOUBLE_EQ(CovarianceFactor(map, 0.4), 22.0);
  EXPECT_DOUBLE_EQ(CovarianceFactor(map, 10.0), CovarianceFactor(map, kMaxFactorDistance));
}

TEST(CovarianceFactor, DistanceIsTheMeanOfTheKeyFrames) {
  LineMap map;
  map.key_frames.resize(2);
  map.key_frames[0].cam_from_world = {ExpSo3({0.0, 0.1, 0.0}), Eigen::Vector3d::Zero()};
  map.key_frames[1].cam_from_world = {Eigen::Quaterniond::Identity(), {0.3, 0.0, 0.0}};
  EXPECT_NEAR(MeanDistance(map, std::vector<uint32_t>{0, 1}, Rigid3{}), 0.2, 1e-12);
  EXPECT_EQ(MeanDistance(map, {}, Rigid3{}), 0.0);
}

}  // namespace
}  // namespace plumb
