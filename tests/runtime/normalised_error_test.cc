// Covariances of refined poses keep what they promise on maps whose errors are known.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "plumb/runtime/covariance_calibration.h"
#include "plumb/runtime/pose_refiner.h"
#include "support/synthetic_room.h"

namespace plumb {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr float kPixelNoise = 0.5f, kFusedNoiseM = 0.002f;

/// A walk along the room, a key frame every 15 cm, which looks around.
std::vector<Rigid3> Walk() {
  std::vector<Rigid3> poses;
  for (int k = 0; k < 40; ++k) {
    const double angle = 0.1 * k;
    poses.push_back(testing::LookAlong(
        {-1.5 + 0.07 * k, 0.5 * std::sin(0.2 * k), 0.1 + 0.05 * std::cos(0.3 * k)},
        {std::cos(angle), std::sin(angle), -0.1}));
  }
  return poses;
}

/// A room's map with the errors that it claims: fused lines are off by 2 mm across; key frames'
/// segments by half a pixel at each end, and along the rays by a depth camera's noise. Calibrated
/// as `map build` does.
LineMap NoisyMap(const std::vector<Segment3>& lines, const std::vector<Rigid3>& key_frames,
                 Random* random) {
  LineMap map = testing::MapOf(lines, key_frames, kFusedNoiseM);
  for (MapLine& line : map.lines) {
    const Eigen::Vector3d d = line.segment_in_world.Delta().normalized();
    for (Eigen::Vector3d* end : {&line.segment_in_world.start, &line.segment_in_world.end}) {
      const Eigen::Vector3d noise = random->Normal3(kFusedNoiseM).cast<double>();
      *end += noise - noise.dot(d) * d;
    }
  }
  for (KeyFrame& key_frame : map.key_frames) {
    const Rigid3 world_from_cam = key_frame.cam_from_world.Inverse();
    for (LiftedSegment& lifted : key_frame.segments) {
      const auto disturb = [&](Eigen::Vector2d* pixel, Eigen::Vector3d* in_world) {
        const Eigen::Vector3d draw = random->Normal3(1.0f).cast<double>();
        const double z = (key_frame.cam_from_world * *in_world).z();
        *pixel += kPixelNoise * draw.head<2>();
        const double depth = z + draw.z() * (0.004 * z * z + 0.003);
        *in_world =
            world_from_cam * (depth * key_frame.camera.Normalize(*pixel).homogeneous().eval());
      };
      disturb(&lifted.segment_px.start, &lifted.segment_in_world.start);
      disturb(&lifted.segment_px.end, &lifted.segment_in_world.end);
    }
  }
  const CovarianceCalibration calibration = CalibrateCovariance(map);
  map.covariance_factor = calibration.factor;
  map.covariance_growth = calibration.growth;
  return map;
}

/// Squared errors over the covariances of 120 poses must be as large as those of a chi-square
/// variable with 6 degrees of freedom, to a factor of 2.
void ExpectHonest(const std::vector<Rigid3>& key_frames, bool is_calibrated) {
  const std::vector<Segment3> lines = testing::RoomLines();
  Random random(31);
  std::vector<double> squares;
  for (int m = 0; m < 10; ++m) {
    const LineMap map = NoisyMap(lines, key_frames, &random);
    EXPECT_EQ(map.covariance_factor != kUncalibratedFactor, is_calibrated);
    const MapIndex index(map);
    const auto refiner = PoseRefiner::Create(index, {});
    ASSERT_TRUE(refiner.has_value());
    for (int k = 0; k < 12; ++k) {
      const Rigid3 truth =
          testing::LookAlong({-1.4 + 0.23 * k, 0.5 * std::sin(0.65 * k) - 0.1, 0.15},
                             {std::cos(0.33 * k), std::sin(0.33 * k), -0.15});
      const auto segments = testing::Render(lines, truth, 100 * m + k, {.noise_px = kPixelNoise});
      RefineInput input;
      input.camera = testing::RoomCamera();
      input.segments = segments;
      input.prior = {testing::Disturb(truth, 0.10, 2.0 * kDegree, &random), 0.10, 2.0 * kDegree};
      input.seed = static_cast<uint64_t>(k);
      RefineResult result;
      ASSERT_TRUE((*refiner)->Refine(input, &result));
      if (result.status != RefineStatus::kRefined) continue;
      const Vector6d error = Difference(truth, result.cam_from_world);
      squares.push_back(error.dot(result.covariance.llt().solve(error)));
    }
  }
  ASSERT_GT(squares.size(), 110u);
  double mean = 0.0;
  for (const double square : squares) mean += square / static_cast<double>(squares.size());
  std::sort(squares.begin(), squares.end());
  const double median = squares[squares.size() / 2];
  // Their mean and median.
  EXPECT_GT(median, 0.5 * 5.35);
  EXPECT_LT(median, 2.0 * 5.35);
  EXPECT_GT(mean, 0.5 * 6.0);
  EXPECT_LT(mean, 2.0 * 6.0);
}

TEST(NormalisedError, IsWithinTwiceItsExpectation) { ExpectHonest(Walk(), true); }

// A metre apart, key frames do not see each other's lines.
TEST(NormalisedError, IsSoOnAMapTooSparseToBeCalibrated) {
  ExpectHonest(testing::RoomKeyFrames(), false);
}

}  // namespace
}  // namespace plumb
