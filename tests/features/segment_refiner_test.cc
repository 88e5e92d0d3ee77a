// The whole step: selection, edges, duplicates.
#include "plumb/features/segment_refiner.h"

#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "support/edge_image.h"

namespace plumb {
namespace {

using testing::DistanceFromLine;
using testing::GrayImage;
using testing::SoftRectangle;

class SegmentRefinerTest : public ::testing::Test {
 protected:
  SegmentRefinerTest() : image_(200, 160) { rectangle_.Draw(&image_); }

  // A piece of the top border, from x0 to x1, `below` px too low.
  static Segment2 Top(double x0, double x1, double score = 1.0, double below = 0.0) {
    return {{x0, 40.0 + below}, {x1, 40.0 + below}, score};
  }
  Segment2 Border(size_t i) const { return rectangle_.Borders()[i]; }

  const SoftRectangle rectangle_{{100, 80}, {70, 40}};
  GrayImage image_;
};

TEST_F(SegmentRefinerTest, MovesEverySegmentOnToItsEdge) {
  SegmentRefiner refiner({});
  const std::vector<Segment2> raw = {Top(50, 150, 0.9, 1.5), {{31.0, 60}, {30.5, 110}, 0.5}};
  const std::vector<Segment2> refined = refiner.Refine(image_.View(), raw);
  ASSERT_EQ(refined.size(), 2u);
  EXPECT_LT(DistanceFromLine(refined[0], Border(0)), 0.1);
  EXPECT_LT(DistanceFromLine(refined[1], Border(3)), 0.1);
  EXPECT_EQ(refined[0].score, 0.9);
}

TEST_F(SegmentRefinerTest, ColourImagesUseTheirLuminance) {
  std::vector<uint8_t> rgb;
  for (const uint8_t gray : image_.pixels) rgb.insert(rgb.end(), 3, gray);
  ImageView colour = image_.View();
  colour.format = PixelFormat::kRgb8;
  colour.planes[0] = {rgb.data(), 600};
  const std::vector<Segment2> raw = {Top(50, 150, 1.0, 1.0)};
  SegmentRefiner refiner({});
  const auto a = refiner.Refine(image_.View(), raw), b = refiner.Refine(colour, raw);
  ASSERT_EQ(a.size(), 1u);
  ASSERT_EQ(b.size(), 1u);
  EXPECT_EQ(a[0].start, b[0].start);
  EXPECT_EQ(a[0].end, b[0].end);
}

TEST_F(SegmentRefinerTest, DropsTheWeakerOfTwoThatExplainTheSameEdge) {
  SegmentRefiner refiner({});
  const std::vector<Segment2> raw = {Top(50, 150, 0.9), Top(60, 140, 0.8, 0.5)};
  const auto refined = refiner.Refine(image_.View(), raw);
  ASSERT_EQ(refined.size(), 1u);
  EXPECT_EQ(refined[0].score, 0.9);
}

TEST_F(SegmentRefinerTest, KeepsALongerOneOfWhichLittleIsCovered) {
  SegmentRefiner refiner({});
  const std::vector<Segment2> raw = {Top(50, 90, 0.9), Top(50, 150, 0.8)};
  EXPECT_EQ(refiner.Refine(image_.View(), raw).size(), 2u);
}

TEST_F(SegmentRefinerTest, FragmentsOfOneEdgeAreNoDuplicates) {
  SegmentRefiner refiner({});
  const std::vector<Segment2> raw = {Top(40, 80, 0.9), Top(85, 120, 0.8), Top(125, 160, 0.7)};
  EXPECT_EQ(refiner.Refine(image_.View(), raw).size(), 3u);
}

TEST_F(SegmentRefinerTest, DuplicatesCanBeKept) {
  SegmentRefinerOptions options;
  options.remove_duplicates = false;
  SegmentRefiner refiner(options);
  const std::vector<Segment2> raw = {Top(50, 150, 0.9), Top(150, 50, 0.8)};
  EXPECT_EQ(refiner.Refine(image_.View(), raw).size(), 2u);
}

TEST_F(SegmentRefinerTest, AnOppositeDirectionIsTheSameSegment) {
  SegmentRefiner refiner({});
  const std::vector<Segment2> raw = {Top(50, 150, 0.9), Top(150, 50, 0.8)};
  EXPECT_EQ(refiner.Refine(image_.View(), raw).size(), 1u);
}

TEST_F(SegmentRefinerTest, TrimDropsSegmentsWithoutAnEdge) {
  const std::vector<Segment2> raw = {{{60, 80}, {140, 80}, 0.9}, Top(50, 150, 0.8)};
  EXPECT_EQ(SegmentRefiner({}).Refine(image_.View(), raw).size(), 1u);
  SegmentRefinerOptions untrimmed;
  untrimmed.trim = false;
  EXPECT_EQ(SegmentRefiner(untrimmed).Refine(image_.View(), raw).size(), 2u);
}

TEST_F(SegmentRefinerTest, ShortSegmentsAreDroppedBeforeAndAfter) {
  SegmentRefiner refiner({});
  // 12 px exactly, and one that is cut from 16 px to about 10 px at the corner.
  const std::vector<Segment2> raw = {Top(50, 62), {{162, 40}, {178, 40}, 0.5}};
  EXPECT_TRUE(refiner.Refine(image_.View(), raw).empty());
}

TEST_F(SegmentRefinerTest, ScoreThresholdNeverGoesBelowTheBestFew) {
  SegmentRefinerOptions options;
  options.min_score = 0.5;
  options.min_count = 2;
  const std::vector<Segment2> raw = {Top(40, 60, 0.4), Top(65, 85, 0.3), Top(90, 110, 0.2)};
  EXPECT_EQ(SegmentRefiner(options).Refine(image_.View(), raw).size(), 2u);
  options.min_count = 0;
  EXPECT_EQ(SegmentRefiner(options).Refine(image_.View(), raw).size(), 0u);
}

TEST_F(SegmentRefinerTest, TheBestAreKeptWhateverTheirOrder) {
  SegmentRefinerOptions options;
  options.max_count = 2;
  const std::vector<Segment2> raw = {Top(40, 60, 0.1), Top(65, 85, 0.9), Top(90, 110, 0.5)};
  const auto refined = SegmentRefiner(options).Refine(image_.View(), raw);
  ASSERT_EQ(refined.size(), 2u);
  EXPECT_EQ(refined[0].score, 0.9);
  EXPECT_EQ(refined[1].score, 0.5);
}

TEST_F(SegmentRefinerTest, EqualScoresKeepTheirOrder) {
  const std::vector<Segment2> raw = {Top(40, 60), Top(65, 85), Top(90, 110), Top(115, 135)};
  const auto refined = SegmentRefiner({}).Refine(image_.View(), raw);
  ASSERT_EQ(refined.size(), 4u);
  for (size_t i = 1; i < 4; ++i) EXPECT_GT(refined[i].start.x(), refined[i - 1].start.x());
}

TEST_F(SegmentRefinerTest, BrokenSegmentsAreDropped) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::vector<Segment2> raw = {{{kNan, 40}, {80, 40}, 1.0},
                                     {{40, 40}, {kInfinity, 40}, 1.0},
                                     {{-1e9, 40}, {1e9, 40}, 1.0},
                                     {{50, 40}, {50, 40}, 1.0},
                                     Top(50, 90, kNan),
                                     Top(100, 150, 0.5)};
  const auto refined = SegmentRefiner({}).Refine(image_.View(), raw);
  ASSERT_EQ(refined.size(), 1u);
  EXPECT_EQ(refined[0].score, 0.5);
}

TEST_F(SegmentRefinerTest, NothingComesOfNothingOrOfABrokenImage) {
  SegmentRefiner refiner({});
  EXPECT_TRUE(refiner.Refine(image_.View(), {}).empty());
  const std::vector<Segment2> raw = {Top(50, 150)};
  ImageView broken = image_.View();
  broken.planes[0].data = nullptr;
  EXPECT_TRUE(refiner.Refine(broken, raw).empty());
}

TEST_F(SegmentRefinerTest, ReusedRefinerGivesTheSameBytes) {
  const std::vector<Segment2> raw = {Top(50, 150, 0.9, 1.5), {{31, 60}, {30.5, 110}, 0.5}};
  SegmentRefiner refiner({});
  const auto first = refiner.Refine(image_.View(), raw);
  refiner.Refine(GrayImage(64, 64, 3).View(), raw);
  std::vector<Segment2> second(7);
  refiner.Refine(image_.View(), raw, &second);
  ASSERT_EQ(first.size(), second.size());
  for (size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].start, second[i].start);
    EXPECT_EQ(first[i].end, second[i].end);
  }
}

class SegmentRefinerBarTest : public ::testing::Test {
 protected:
  SegmentRefinerBarTest() : image_(200, 160) { bar_.Draw(&image_); }

  const SoftRectangle bar_{{100, 80}, {70, 1.5}, 0.2};
  GrayImage image_;
};

TEST_F(SegmentRefinerBarTest, OneDetectedBorderGivesBoth) {
  Segment2 raw = bar_.Borders()[0];
  raw.score = 0.7;
  const auto refined = SegmentRefiner({}).Refine(image_.View(), std::vector<Segment2>{raw});
  ASSERT_EQ(refined.size(), 2u);
  EXPECT_LT(DistanceFromLine(refined[0], bar_.Borders()[0]), 0.3);
  EXPECT_LT(DistanceFromLine(refined[1], bar_.Borders()[2]), 0.3);
  EXPECT_EQ(refined[1].score, 0.7);
}

TEST_F(SegmentRefinerBarTest, WhicheverIsDetectedTheResultIsTheSamePair) {
  const Segment2 top = bar_.Borders()[0], bottom = bar_.Borders()[2];
  const auto of_bottom = SegmentRefiner({}).Refine(image_.View(), std::vector<Segment2>{bottom});
  const auto of_both = SegmentRefiner({}).Refine(image_.View(), std::vector<Segment2>{top, bottom});
  ASSERT_EQ(of_bottom.size(), 2u);
  ASSERT_EQ(of_both.size(), 2u);
  EXPECT_LT(DistanceFromLine(of_bottom[1], of_both[0]), 0.1);
  EXPECT_LT(DistanceFromLine(of_bottom[0], of_both[1]), 0.1);
}

TEST_F(SegmentRefinerBarTest, OtherBordersCanBeLeftOut) {
  SegmentRefinerOptions options;
  options.add_other_borders = false;
  const std::vector<Segment2> raw = {bar_.Borders()[0]};
  EXPECT_EQ(SegmentRefiner(options).Refine(image_.View(), raw).size(), 1u);
}

}  // namespace
}  // namespace plumb
