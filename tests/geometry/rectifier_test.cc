// Pixels of the taken image to the ideal one and back.
#include "plumb/geometry/rectifier.h"

#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

namespace plumb {
namespace {

constexpr Camera kPinhole{400.0, 410.0, 318.0, 243.0, 640, 480};

Rectifier Make(LensModel model, const std::vector<double>& coefficients,
               const Camera& pinhole = kPinhole) {
  return *Rectifier::Create({pinhole, *MakeLens(model, coefficients)});
}

TEST(Rectifier, WithoutALensIsTheIdentityBitForBit) {
  const Rectifier rectifier = *Rectifier::Create(kPinhole);
  EXPECT_TRUE(rectifier.IsIdentity());
  EXPECT_EQ(rectifier.ideal().cx, kPinhole.cx);
  EXPECT_EQ(rectifier.ideal().width_px, kPinhole.width_px);
  const Eigen::Vector2d px(17.25, -3.0);
  EXPECT_EQ(*rectifier.ToIdeal(px), px);
  EXPECT_EQ(rectifier.ToImage(px)->px, px);
}

TEST(Rectifier, TheIdealImageHoldsTheWholeTakenOne) {
  for (const Rectifier& rectifier : {Make(LensModel::kRadTan, {-0.3, 0.1, 0.001, -0.002}),
                                     Make(LensModel::kRadTan, {0.2, 0.02, 0.0, 0.0, 0.01}),
                                     Make(LensModel::kKannalaBrandt, {-0.01, 0.002, 0.0, 0.0})}) {
    EXPECT_EQ(rectifier.ideal().fx, kPinhole.fx);
    for (int y = 0; y < 480; y += 7) {
      for (int x = 0; x < 640; x += 7) {
        const auto ideal = rectifier.ToIdeal(Eigen::Vector2d(x, y));
        ASSERT_TRUE(ideal) << x << ", " << y;
        EXPECT_TRUE(rectifier.ideal().Contains(*ideal)) << ideal->transpose();
        const auto back = rectifier.ToImage(*ideal);
        ASSERT_TRUE(back);
        EXPECT_LT((back->px - Eigen::Vector2d(x, y)).norm(), 1e-8);
      }
    }
  }
}

TEST(Rectifier, AtTheCentreImagesDifferByWholePixels) {
  const Rectifier rectifier = Make(LensModel::kRadTan, {-0.3, 0.1, 0.0, 0.0});
  const Eigen::Vector2d shift =
      *rectifier.ToIdeal({kPinhole.cx, kPinhole.cy}) - Eigen::Vector2d(kPinhole.cx, kPinhole.cy);
  EXPECT_NEAR(shift.x(), std::round(shift.x()), 1e-9);
  EXPECT_NEAR(shift.y(), std::round(shift.y()), 1e-9);
  EXPECT_GT(shift.x(), 0.0) << "a barrel's ideal image is larger";
}

TEST(Rectifier, TheJacobianIsInPixelsAlsoWhenMirrored) {
  Camera mirrored = kPinhole;
  mirrored.fy = -mirrored.fy;
  for (const Camera& pinhole : {kPinhole, mirrored}) {
    const Rectifier rectifier = Make(LensModel::kRadTan, {-0.3, 0.1, 0.003, -0.002}, pinhole);
    const Eigen::Vector2d at = *rectifier.ToIdeal({100.0, 60.0});
    const Eigen::Matrix2d jacobian = rectifier.ToImage(at)->jacobian;
    EXPECT_GT(jacobian.determinant(), 0.0);
    for (int i = 0; i < 2; ++i) {
      const Eigen::Vector2d step = 1e-4 * Eigen::Vector2d::Unit(i);
      const Eigen::Vector2d numerical =
          (rectifier.ToImage(at + step)->px - rectifier.ToImage(at - step)->px) / 2e-4;
      EXPECT_LT((jacobian.col(i) - numerical).norm(), 1e-6);
    }
  }
}

TEST(Rectifier, CornersThatCannotBeUndistortedAreLeftOut) {
  const Rectifier rectifier = Make(LensModel::kRadTan, {-0.3, 0.0, 0.0, 0.0});
  EXPECT_FALSE(rectifier.ToIdeal({0.0, 0.0}));
  EXPECT_TRUE(rectifier.ToIdeal({320.0, 0.0}));
  EXPECT_TRUE(rectifier.ideal().IsValid());
  EXPECT_LT(rectifier.ideal().width_px, 1000);
  EXPECT_FALSE(rectifier.ToImage({-1e6, 0.0}));
  EXPECT_FALSE(rectifier.ToIdeal({std::numeric_limits<double>::quiet_NaN(), 3.0}));
}

TEST(Rectifier, AWideFisheyeHasAFiniteIdealImage) {
  Camera pinhole = kPinhole;
  pinhole.fx = pinhole.fy = 200.0;  // 183 degrees across
  const Rectifier rectifier = Make(LensModel::kKannalaBrandt, {0.0, 0.0, 0.0, 0.0}, pinhole);
  EXPECT_FALSE(rectifier.ToIdeal({0.0, 243.0}));
  EXPECT_TRUE(rectifier.ToIdeal({318.0 - 200.0 * 1.2, 243.0}));
  EXPECT_LT(rectifier.ideal().width_px, 2 * 200 * 4);
}

TEST(Rectifier, ImpossibleCamerasAreRefused) {
  Camera pinhole = kPinhole;
  pinhole.fx = 0.0;
  EXPECT_FALSE(Rectifier::Create(pinhole));
  pinhole = kPinhole;
  pinhole.cx = 1e6;
  EXPECT_FALSE(Rectifier::Create(
      {pinhole, *MakeLens(LensModel::kRadTan, std::vector<double>{-0.3, 0.0, 0.0, 0.0})}));
  Lens lens;
  lens.model = LensModel::kRadTan;
  lens.coefficients[0] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(Rectifier::Create({kPinhole, lens}));
}

}  // namespace
}  // namespace plumb
