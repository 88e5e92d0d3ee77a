#include "plumb/points/point_features.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "plumb/points/point_lifting.h"
#include "support/textured_corner.h"

namespace plumb {
namespace {

using ::testing::HasSubstr;
using testing::RenderedView;
using testing::TexturedCorner;

constexpr Camera kCamera{260.0, 260.0, 159.5, 119.5, 320, 240};

GrayImage ViewOf(const RenderedView& view) {
  return {view.gray.data(), view.camera.width_px, view.camera.width_px, view.camera.height_px};
}
DepthView DepthOf(const RenderedView& view) {
  return {DepthFormat::kFloat,  view.depth_m.data(),   4LL * view.camera.width_px,
          view.camera.width_px, view.camera.height_px, 1.0};
}

RenderedView SomeView() { return TexturedCorner(1).Render(kCamera, {}); }

TEST(PointExtractor, FindsPointsInsideATexturedImage) {
  const RenderedView view = SomeView();
  ImagePoints points;
  ASSERT_TRUE(PointExtractor().Extract(ViewOf(view), &points));
  EXPECT_GT(points.size(), 200u);
  ASSERT_EQ(points.pixels.size(), points.descriptors.size());
  for (const Eigen::Vector2f& pixel : points.pixels) {
    EXPECT_TRUE(kCamera.Contains(pixel.cast<double>()));
  }
}

TEST(PointExtractor, FindsNothingInAFlatImage) {
  const std::vector<uint8_t> gray(64 * 48, 99);
  ImagePoints points;
  points.pixels.resize(3);
  ASSERT_TRUE(PointExtractor().Extract({gray.data(), 64, 64, 48}, &points));
  EXPECT_EQ(points.size(), 0u);
}

TEST(PointExtractor, PutsASpotWhereItIs) {
  // A round spot with its centre at (40.3, 29.6), the first pixel's centre being (0, 0).
  constexpr double kX = 40.3, kY = 29.6;
  std::vector<uint8_t> gray;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 80; ++x) {
      const double square = (x - kX) * (x - kX) + (y - kY) * (y - kY);
      gray.push_back(static_cast<uint8_t>(50.5 + 180.0 * std::exp(-square / (2.0 * 16.0))));
    }
  }
  ImagePoints points;
  ASSERT_TRUE(PointExtractor().Extract({gray.data(), 80, 80, 64}, &points));
  ASSERT_GT(points.size(), 0u);
  for (const Eigen::Vector2f& pixel : points.pixels) {
    EXPECT_NEAR(pixel.x(), kX, 0.1);
    EXPECT_NEAR(pixel.y(), kY, 0.1);
  }
}

TEST(PointExtractor, KeepsTheStrongestWhenThereAreMore) {
  const RenderedView view = SomeView();
  ImagePoints points;
  ASSERT_TRUE(PointExtractor({.max_count = 50}).Extract(ViewOf(view), &points));
  EXPECT_GE(points.size(), 45u);
  EXPECT_LE(points.size(), 60u) << "A few more come from places with several orientations.";
}

TEST(PointExtractor, HonoursTheRowStride) {
  const RenderedView view = SomeView();
  std::vector<uint8_t> padded;
  for (int y = 0; y < kCamera.height_px; ++y) {
    const auto row = view.gray.begin() + y * kCamera.width_px;
    padded.insert(padded.end(), row, row + kCamera.width_px);
    padded.insert(padded.end(), 13, 255);
  }
  ImagePoints expected, points;
  PointExtractor extractor;
  ASSERT_TRUE(extractor.Extract(ViewOf(view), &expected));
  ASSERT_TRUE(extractor.Extract(
      {padded.data(), kCamera.width_px + 13, kCamera.width_px, kCamera.height_px}, &points));
  EXPECT_EQ(points.pixels, expected.pixels);
  EXPECT_EQ(points.descriptors, expected.descriptors);
}

TEST(PointExtractor, NamesABadImage) {
  const std::vector<uint8_t> gray(64 * 48, 99);
  ImagePoints points;
  PointExtractor extractor;
  EXPECT_FALSE(extractor.Extract({nullptr, 64, 64, 48}, &points));
  EXPECT_FALSE(extractor.Extract({gray.data(), 63, 64, 48}, &points));
  EXPECT_FALSE(extractor.Extract({gray.data(), 64, -64, 48}, &points));
  const Status status = extractor.Extract({gray.data(), 64, 64, 15}, &points);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(status.error().message, HasSubstr("64 x 15"));
}

TEST(LiftPoints, PutsPointsOnTheSurfaceThatTheyShow) {
  const Eigen::Quaterniond rotation = ExpSo3({0.2, -0.1, 0.05});
  const RenderedView view = TexturedCorner(2).Render(kCamera, {rotation, {0.1, 0.2, 0.3}});
  ImagePoints points;
  ASSERT_TRUE(PointExtractor().Extract(ViewOf(view), &points));
  const auto lifted =
      LiftPoints(points, *Rectifier::Create(kCamera), view.cam_from_world, DepthOf(view));
  EXPECT_GT(lifted.size(), points.size() / 2);
  for (const MapPoint& point : lifted) {
    const Eigen::Vector3d x = point.point_in_world.cast<double>();
    // The depth is that of the nearest pixel: off by the slope of the surface times half a pixel.
    EXPECT_LT(std::min(std::abs(x.z() - 3.0), std::abs(x.y() - 1.0)), 0.015);
    const Eigen::Vector2d image = kCamera.Project(view.cam_from_world * x);
    EXPECT_LT((image - point.pixel.cast<double>()).norm(), 1e-3);
  }
}

/// One point in the middle of a depth image of 9 x 9 pixels, 2 m away.
class OnePointTest : public ::testing::Test {
 protected:
  OnePointTest() : depth_(81, 2.0f) {
    points_.pixels = {{4.0f, 4.0f}};
    points_.descriptors.resize(1);
  }
  size_t NumLifted() const {
    const DepthView view = {DepthFormat::kFloat, depth_.data(), 36, 9, 9, 1.0};
    return LiftPoints(points_, *Rectifier::Create(Camera{100.0, 100.0, 4.0, 4.0, 9, 9}), {}, view)
        .size();
  }
  float& DepthAt(int x, int y) { return depth_[static_cast<size_t>(9 * y + x)]; }

  ImagePoints points_;
  std::vector<float> depth_;
};

TEST_F(OnePointTest, IsLiftedFromSmoothDepth) { EXPECT_EQ(NumLifted(), 1u); }

TEST_F(OnePointTest, IsLeftOutWithoutDepth) {
  DepthAt(4, 4) = 0.0f;
  EXPECT_EQ(NumLifted(), 0u);
}

TEST_F(OnePointTest, IsLeftOutBesideAJumpOfDepth) {
  DepthAt(6, 2) = 2.05f;
  EXPECT_EQ(NumLifted(), 1u);
  DepthAt(6, 2) = 2.07f;
  EXPECT_EQ(NumLifted(), 0u);
}

TEST_F(OnePointTest, IsLeftOutBesideAHole) {
  DepthAt(4, 6) = 0.0f;
  EXPECT_EQ(NumLifted(), 0u);
}

TEST_F(OnePointTest, IsLeftOutWhenTooNearOrTooFar) {
  for (const float depth : {0.19f, 6.01f}) {
    depth_.assign(81, depth);
    EXPECT_EQ(NumLifted(), 0u) << depth;
  }
}

TEST_F(OnePointTest, IsLeftOutOutsideTheDepthImage) {
  for (const Eigen::Vector2f& pixel : {Eigen::Vector2f(-0.6f, 4.0f), Eigen::Vector2f(4.0f, 8.6f)}) {
    points_.pixels[0] = pixel;
    EXPECT_EQ(NumLifted(), 0u) << pixel.transpose();
  }
}

}  // namespace
}  // namespace plumb
