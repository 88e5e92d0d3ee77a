#include "plumb/geometry/camera.h"

#include <gtest/gtest.h>

#include <limits>

namespace plumb {
namespace {

constexpr Camera kCamera{500.0, 510.0, 320.0, 240.0, 640, 480};

TEST(Camera, ProjectsTheOpticalAxisToThePrincipalPoint) {
  EXPECT_EQ(kCamera.Project({0.0, 0.0, 7.0}), Eigen::Vector2d(320.0, 240.0));
}

TEST(Camera, HasXToTheRightAndYDown) {
  const Eigen::Vector2d px = kCamera.Project({0.2, 0.1, 2.0});
  EXPECT_DOUBLE_EQ(px.x(), 320.0 + 50.0);
  EXPECT_DOUBLE_EQ(px.y(), 240.0 + 25.5);
}

TEST(Camera, NormalizeInvertsProjectAlsoWhenMirrored) {
  Camera mirrored = kCamera;
  mirrored.fy = -mirrored.fy;
  for (const Camera& camera : {kCamera, mirrored}) {
    const Eigen::Vector3d x(0.7, -0.4, 2.5);
    EXPECT_TRUE(camera.Normalize(camera.Project(x)).isApprox(x.head<2>() / x.z(), 1e-14));
  }
  EXPECT_LT(mirrored.Project({0.0, 1.0, 2.0}).y(), 240.0);
  EXPECT_EQ(mirrored.MeanFocal(), kCamera.MeanFocal());
}

TEST(Camera, IsInvalidWithoutFocalLengthOrSize) {
  EXPECT_TRUE(kCamera.IsValid());
  EXPECT_FALSE(Camera{}.IsValid());
  Camera camera = kCamera;
  camera.fx = 0.0;
  EXPECT_FALSE(camera.IsValid());
  camera = kCamera;
  camera.height_px = 0;
  EXPECT_FALSE(camera.IsValid());
  camera = kCamera;
  camera.width_px = -640;
  EXPECT_FALSE(camera.IsValid());
}

TEST(Camera, IsInvalidWhenANumberIsNotFinite) {
  for (double Camera::*member : {&Camera::fx, &Camera::fy, &Camera::cx, &Camera::cy}) {
    for (const double value :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      Camera camera = kCamera;
      camera.*member = value;
      EXPECT_FALSE(camera.IsValid());
    }
  }
}

TEST(Camera, ContainsTheCentresOfItsOuterPixels) {
  EXPECT_TRUE(kCamera.Contains({0.0, 0.0}));
  EXPECT_TRUE(kCamera.Contains({639.0, 479.0}));
  EXPECT_FALSE(kCamera.Contains({639.1, 479.0}));
  EXPECT_FALSE(kCamera.Contains({0.0, -0.1}));
  EXPECT_TRUE(kCamera.Contains({649.0, -10.0}, /*margin_px=*/10.0));
  EXPECT_FALSE(kCamera.Contains({std::numeric_limits<double>::quiet_NaN(), 0.0}));
}

}  // namespace
}  // namespace plumb
