// Segments at the border of the image.
#include "plumb/features/clip_segment.h"

#include <gtest/gtest.h>

#include <limits>

namespace plumb {
namespace {

constexpr int kWidth = 10, kHeight = 6;

Segment2 Make(double x1, double y1, double x2, double y2) {
  Segment2 segment;
  segment.start = {x1, y1};
  segment.end = {x2, y2};
  segment.score = 0.25;
  return segment;
}

TEST(ClipToImage, LeavesASegmentInsideAsItIs) {
  Segment2 segment = Make(1, 2, 8, 5);
  ASSERT_TRUE(ClipToImage(kWidth, kHeight, &segment));
  EXPECT_EQ(segment.start, Eigen::Vector2d(1, 2));
  EXPECT_EQ(segment.end, Eigen::Vector2d(8, 5));
  EXPECT_EQ(segment.score, 0.25);
}

TEST(ClipToImage, CutsBothEndsAndKeepsTheDirection) {
  Segment2 segment = Make(-10, -7, 20, 23);  // y = x + 3
  ASSERT_TRUE(ClipToImage(kWidth, kHeight, &segment));
  EXPECT_NEAR(segment.start.x(), -0.5, 1e-12);
  EXPECT_NEAR(segment.start.y(), 2.5, 1e-12);
  EXPECT_NEAR(segment.end.x(), 2.5, 1e-12);
  EXPECT_NEAR(segment.end.y(), 5.5, 1e-12);
}

TEST(ClipToImage, DoesNotCareWhichEndComesFirst) {
  Segment2 forth = Make(-3, 1, 12, 4), back = Make(12, 4, -3, 1);
  ASSERT_TRUE(ClipToImage(kWidth, kHeight, &forth));
  ASSERT_TRUE(ClipToImage(kWidth, kHeight, &back));
  EXPECT_NEAR((forth.start - back.end).norm(), 0.0, 1e-12);
  EXPECT_NEAR((forth.end - back.start).norm(), 0.0, 1e-12);
}

TEST(ClipToImage, KeepsHorizontalAndVerticalSegmentsInside) {
  Segment2 horizontal = Make(-5, 3, 25, 3), vertical = Make(4, 50, 4, -50);
  ASSERT_TRUE(ClipToImage(kWidth, kHeight, &horizontal));
  EXPECT_DOUBLE_EQ(horizontal.Length(), kWidth);
  ASSERT_TRUE(ClipToImage(kWidth, kHeight, &vertical));
  EXPECT_DOUBLE_EQ(vertical.Length(), kHeight);
}

TEST(ClipToImage, DropsWhatLiesOutside) {
  for (Segment2 segment : {Make(-5, -5, -1, -1), Make(-5, 3, -1, 3), Make(4, 6, 4, 9),
                           Make(8, 9, 14, 2) /* past the corner */}) {
    EXPECT_FALSE(ClipToImage(kWidth, kHeight, &segment));
  }
}

TEST(ClipToImage, DropsPointsAndCoordinatesThatAreNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (Segment2 segment : {Make(3, 3, 3, 3), Make(nan, 3, 5, 3), Make(2, 3, 5, infinity),
                           Make(-infinity, 3, infinity, 3)}) {
    EXPECT_FALSE(ClipToImage(kWidth, kHeight, &segment));
  }
}

}  // namespace
}  // namespace plumb
