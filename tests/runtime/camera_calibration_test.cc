// The camera of a map's key frames: corrected when its views say so, and left alone when not.
#include "plumb/runtime/camera_calibration.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "support/synthetic_room.h"

namespace plumb {
namespace {

constexpr double kNoisePx = 0.35;

// What key frames of `truth` see when they are taken for views of `given`.
LineMap MapSeenBy(const ImageCamera& truth, const ImageCamera& given, int num_key_frames) {
  std::mt19937 rng(5);
  std::normal_distribution<double> normal;
  const LensMapping lens = *LensMapping::Create(truth.lens);
  const Rectifier rectifier = *Rectifier::Create(given);
  LineMap map = testing::MapOf(testing::RoomLines(), testing::RoomSweep(num_key_frames));
  for (KeyFrame& frame : map.key_frames) {
    frame.camera = rectifier.ideal();
    const auto see = [&](const Eigen::Vector3d& in_world) {
      const auto imaged = lens.Distort((frame.cam_from_world * in_world).hnormalized());
      const Eigen::Vector2d px(truth.pinhole.fx * imaged->point.x() + truth.pinhole.cx,
                               truth.pinhole.fy * imaged->point.y() + truth.pinhole.cy);
      return *rectifier.ToIdeal(px + kNoisePx * Eigen::Vector2d(normal(rng), normal(rng)));
    };
    for (LiftedSegment& segment : frame.segments) {
      segment.segment_px = {see(segment.segment_in_world.start), see(segment.segment_in_world.end)};
    }
  }
  return map;
}

std::optional<CameraCorrection> Calibrate(const ImageCamera& truth, const ImageCamera& given,
                                          int num_key_frames = 36) {
  return CalibrateCamera(MapSeenBy(truth, given, num_key_frames), *Rectifier::Create(given));
}

TEST(CalibrateCamera, FindsTheLensThatWasNotGiven) {
  const ImageCamera given = testing::RoomCamera();
  const ImageCamera truth(given.pinhole, {LensModel::kRadTan, {0.02, -0.05}});
  const auto correction = Calibrate(truth, given);
  ASSERT_TRUE(correction);
  EXPECT_EQ(correction->given, given);
  EXPECT_LT(LargestShiftPx({truth, correction->corrected}), 0.4);
  EXPECT_GT(LargestShiftPx(*correction), 2.0);
}

TEST(CalibrateCamera, FindsAFocalLengthThatIsOffByAPercent) {
  const ImageCamera truth(testing::RoomCamera(), {LensModel::kRadTan, {-0.1, 0.02}});
  ImageCamera given = truth;
  given.pinhole.fx *= 1.01;
  given.pinhole.fy *= 1.01;
  const auto correction = Calibrate(truth, given);
  ASSERT_TRUE(correction);
  EXPECT_NEAR(correction->corrected.pinhole.fx, truth.pinhole.fx, 0.6);
  EXPECT_LT(LargestShiftPx({truth, correction->corrected}), 0.4);
}

TEST(CalibrateCamera, LeavesARightCameraAlone) {
  const ImageCamera camera = testing::RoomCamera();
  EXPECT_FALSE(Calibrate(camera, camera));
}

TEST(CalibrateCamera, NeedsEnoughSightings) {
  const ImageCamera given = testing::RoomCamera();
  const ImageCamera truth(given.pinhole, {LensModel::kRadTan, {0.02, -0.05}});
  EXPECT_FALSE(Calibrate(truth, given, 4));
  EXPECT_FALSE(CalibrateCamera(LineMap{}, *Rectifier::Create(given)));
}

// Key frames of two cameras' worth of error: what one half says, the other denies.
TEST(CalibrateCamera, RefusesWhatTheOtherHalfDenies) {
  const ImageCamera given = testing::RoomCamera();
  const ImageCamera barrel(given.pinhole, {LensModel::kRadTan, {-0.03}});
  const ImageCamera pincushion(given.pinhole, {LensModel::kRadTan, {0.03}});
  LineMap map = MapSeenBy(barrel, given, 36);
  const LineMap other = MapSeenBy(pincushion, given, 36);
  for (size_t k = 18; k < 36; ++k) map.key_frames[k].segments = other.key_frames[k].segments;
  EXPECT_FALSE(CalibrateCamera(map, *Rectifier::Create(given)));
}

TEST(LargestShiftPx, IsThatOfTheCornersForARadialLens) {
  const ImageCamera given(Camera{500.0, 500.0, 320.0, 240.0, 641, 481});
  const ImageCamera corrected(given.pinhole, {LensModel::kRadTan, {0.1}});
  const double radius = std::hypot(320.0, 240.0) / 500.0;
  EXPECT_NEAR(LargestShiftPx({given, corrected}), 500.0 * 0.1 * radius * radius * radius, 1e-9);
  EXPECT_EQ(LargestShiftPx({given, given}), 0.0);
}

}  // namespace
}  // namespace plumb
