// OpenCV's LSD behind the common interface.
#include "plumb/features/lsd_detector.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "support/edge_image.h"

namespace plumb {
namespace {

using testing::DistanceFromLine;
using testing::GrayImage;
using testing::SoftRectangle;

TEST(LsdDetector, FindsTheBordersOfARectangle) {
  for (const double angle : {0.0, 0.3, 1.0}) {
    const SoftRectangle rectangle{{160, 120}, {90, 50}, angle};
    GrayImage image(320, 240);
    rectangle.Draw(&image);
    const auto segments = CreateLsdDetector()->Detect(image.View());
    ASSERT_TRUE(segments);
    for (const Segment2& border : rectangle.Borders()) {
      const bool found = std::any_of(segments->begin(), segments->end(), [&](const Segment2& s) {
        return DistanceFromLine(s, border) < 1.0 && s.Length() > 0.8 * border.Length();
      });
      EXPECT_TRUE(found) << angle;
    }
  }
}

TEST(LsdDetector, HasNoShiftInEitherDirection) {
  // Opposite borders: a common shift shows as a difference of their signed distances.
  const SoftRectangle rectangle{{160.0, 120.0}, {90, 50}};
  GrayImage image(320, 240);
  rectangle.Draw(&image);
  const auto segments = CreateLsdDetector()->Detect(image.View());
  ASSERT_TRUE(segments);
  double shift_x = 0.0, shift_y = 0.0;
  int num_x = 0, num_y = 0;
  for (const Segment2& s : *segments) {
    const Eigen::Vector2d middle = s.Midpoint();
    if (std::abs(s.Delta().x()) > 100.0) {
      shift_y += std::abs(middle.y() - 70.0) < 3.0 ? middle.y() - 70.0 : middle.y() - 170.0;
      ++num_y;
    } else if (std::abs(s.Delta().y()) > 60.0) {
      shift_x += std::abs(middle.x() - 70.0) < 3.0 ? middle.x() - 70.0 : middle.x() - 250.0;
      ++num_x;
    }
  }
  ASSERT_EQ(num_x, 2);
  ASSERT_EQ(num_y, 2);
  EXPECT_NEAR(shift_x / num_x, 0.0, 0.15);
  EXPECT_NEAR(shift_y / num_y, 0.0, 0.15);
}

TEST(LsdDetector, BestScoreFirstAndNothingShort) {
  std::mt19937 random(1);
  GrayImage image(320, 240, 128);
  for (int i = 0; i < 30; ++i) {
    const int x0 = static_cast<int>(random() % 280), y0 = static_cast<int>(random() % 200);
    const uint8_t value = static_cast<uint8_t>(random() & 255u);
    for (int y = y0; y < y0 + 30; ++y) {
      for (int x = x0; x < x0 + 40; ++x) image.At(x, y) = value;
    }
  }
  const auto segments = CreateLsdDetector()->Detect(image.View());
  ASSERT_TRUE(segments);
  ASSERT_GT(segments->size(), 20u);
  for (size_t i = 0; i < segments->size(); ++i) {
    const Segment2& s = (*segments)[i];
    EXPECT_GT(s.Length(), 12.0);
    EXPECT_GT(s.score, 0.0);
    EXPECT_LT(s.score, 1.0);
    EXPECT_LE(s.score, (*segments)[i == 0 ? 0 : i - 1].score);
  }
}

TEST(LsdDetector, FlatAndTinyImagesHaveNoSegments) {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 500), std::pair(7, 7),
                                      std::pair(8, 8), std::pair(9, 300), std::pair(64, 64)}) {
    const auto segments = CreateLsdDetector()->Detect(GrayImage(width, height, 40).View());
    ASSERT_TRUE(segments) << width << " x " << height;
    EXPECT_TRUE(segments->empty());
  }
}

TEST(LsdDetector, NoiseOfAnySizeIsSurvived) {
  std::mt19937 random(2);
  for (const auto& [width, height] :
       {std::pair(8, 8), std::pair(8, 100), std::pair(33, 17), std::pair(101, 99)}) {
    GrayImage image(width, height);
    for (uint8_t& pixel : image.pixels) pixel = static_cast<uint8_t>(random() & 255u);
    EXPECT_TRUE(CreateLsdDetector()->Detect(image.View())) << width << " x " << height;
  }
}

TEST(LsdDetector, PaddedRowsChangeNothing) {
  const SoftRectangle rectangle{{50, 40}, {30, 20}, 0.2};
  GrayImage image(100, 80), padded(128, 80, 255);
  rectangle.Draw(&image);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 100; ++x) padded.At(x, y) = image.At(x, y);
  }
  ImageView view = padded.View();
  view.width_px = 100;
  const auto detector = CreateLsdDetector();
  const auto a = detector->Detect(image.View()), b = detector->Detect(view);
  ASSERT_TRUE(a && b);
  ASSERT_EQ(a->size(), b->size());
  ASSERT_FALSE(a->empty());
  for (size_t i = 0; i < a->size(); ++i) EXPECT_EQ((*a)[i].start, (*b)[i].start);
}

TEST(LsdDetector, OneImageIsInFlightAtMost) {
  const auto detector = CreateLsdDetector();
  const GrayImage image(32, 32, 9);
  EXPECT_FALSE(detector->Collect());
  ASSERT_TRUE(detector->Submit(image.View()));
  EXPECT_FALSE(detector->Submit(image.View()));
  EXPECT_TRUE(detector->Collect());
  EXPECT_FALSE(detector->Collect());
}

TEST(LsdDetector, BrokenImageIsRefusedAndForgotten) {
  const auto detector = CreateLsdDetector();
  ImageView broken = GrayImage(32, 32).View();
  broken.planes[0].data = nullptr;
  const Status status = detector->Submit(broken);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(detector->Submit(GrayImage(32, 32).View()));
}

TEST(LsdDetector, WorksInTheForeground) {
  EXPECT_FALSE(CreateLsdDetector()->WorksInBackground());
  EXPECT_EQ(CreateLsdDetector()->Name(), "lsd");
}

}  // namespace
}  // namespace plumb
