#include "plumb/geometry/camera_correction.h"

#include <gtest/gtest.h>

namespace plumb {
namespace {

const ImageCamera kCamera({525.0, 524.0, 320.0, 240.0, 640, 480},
                          {LensModel::kRadTan, {0.1, -0.05, 0.001, 0.0}});

TEST(IsSameCamera, ForgivesTheRoundingOfATextFile) {
  ImageCamera other = kCamera;
  EXPECT_TRUE(IsSameCamera(kCamera, other));
  other.pinhole.fx += 0.009;
  other.pinhole.cy -= 0.009;
  other.lens.coefficients[1] += 9e-7;
  EXPECT_TRUE(IsSameCamera(kCamera, other));
}

TEST(IsSameCamera, TellsEveryNumberApart) {
  for (double Camera::*number : {&Camera::fx, &Camera::fy, &Camera::cx, &Camera::cy}) {
    ImageCamera other = kCamera;
    other.pinhole.*number += 0.02;
    EXPECT_FALSE(IsSameCamera(kCamera, other));
  }
  for (int Camera::*side : {&Camera::width_px, &Camera::height_px}) {
    ImageCamera other = kCamera;
    other.pinhole.*side += 1;
    EXPECT_FALSE(IsSameCamera(kCamera, other));
  }
  for (size_t i = 0; i < kCamera.lens.coefficients.size(); ++i) {
    ImageCamera other = kCamera;
    other.lens.coefficients[i] += 2e-6;
    EXPECT_FALSE(IsSameCamera(kCamera, other)) << i;
  }
  ImageCamera fisheye = kCamera;
  fisheye.lens.model = LensModel::kKannalaBrandt;
  EXPECT_FALSE(IsSameCamera(kCamera, fisheye));
}

}  // namespace
}  // namespace plumb
