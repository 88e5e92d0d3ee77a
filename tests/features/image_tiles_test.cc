// Tiles of an image and the segments of the tiles put together; the detector that does both.
#include "plumb/features/image_tiles.h"

#include <cmath>

#include <gtest/gtest.h>

#include "plumb/features/configured_detector.h"
#include "plumb/features/lsd_detector.h"
#include "support/edge_image.h"

namespace plumb {
namespace {

using testing::DistanceFromLine;
using testing::GrayImage;
using testing::SoftRectangle;

Segment2 Line(double x1, double y1, double x2, double y2, double score = 1.0) {
  return {{x1, y1}, {x2, y2}, score};
}

// Two tiles of 120 x 100 px that share the columns 100 .. 119 of a 220 px wide image.
const std::vector<ImageTile> kTiles = {{0, 0, 120, 100}, {100, 0, 120, 100}};

TEST(ChooseTileGrid, TilesAreAtMostTwoAndAHalfInputsLarge) {
  for (const auto& [width, height] : {std::pair(4000, 3000), {1280, 720}, {801, 800}}) {
    const TileGrid grid = ChooseTileGrid(width, height, 320, 320);
    const ImageTile tile = LayOutTiles(width, height, grid).front();
    EXPECT_LE(tile.width, 802) << width;
    EXPECT_LE(tile.height, 802) << height;
  }
  EXPECT_EQ(ChooseTileGrid(800, 640, 320, 320).columns, 1);
  EXPECT_EQ(ChooseTileGrid(4000, 3000, 0, 0).columns, 1);  // images are taken as they are
}

TEST(LayOutTiles, CoverTheImageOverlapAndBeginAtEvenPlaces) {
  for (const int width : {640, 641, 1283, 4000}) {
    const std::vector<ImageTile> tiles = LayOutTiles(width, 400, {4, 3});
    ASSERT_EQ(tiles.size(), 12u);
    int covered = 0;
    for (int i = 0; i < 4; ++i) {
      const ImageTile& tile = tiles[i];
      EXPECT_EQ(tile.left % 2, 0);
      EXPECT_EQ(tile.width, tiles[0].width);
      if (i > 0) {
        EXPECT_GE(covered - tile.left, tile.width / 8 - 2) << width;
      }
      covered = tile.left + tile.width;
    }
    EXPECT_EQ(covered, width);
    EXPECT_EQ(tiles.back().top + tiles.back().height, 400);
  }
}

TEST(LayOutTiles, SmallImagesAreNotCut) {
  EXPECT_EQ(LayOutTiles(100, 1, {8, 8}).size(), 1u);
  EXPECT_EQ(LayOutTiles(200, 63, {8, 8}).size(), 3u);
}

TEST(ViewOfTile, PointsIntoEveryPlane) {
  std::vector<uint8_t> data(64 * 48 * 3 / 2);
  for (size_t i = 0; i < data.size(); ++i) data[i] = static_cast<uint8_t>(i % 251);
  ImageView image;
  image.format = PixelFormat::kI420;
  image.width_px = 64;
  image.height_px = 48;
  image.planes = {ImageView::Plane{data.data(), 64},
                  {data.data() + 64 * 48, 32},
                  {data.data() + 64 * 48 + 32 * 24, 32}};
  const ImageView tile = ViewOfTile(image, {10, 6, 20, 20});
  EXPECT_TRUE(tile.Validate());
  EXPECT_EQ(tile.planes[0].data, image.planes[0].data + 6 * 64 + 10);
  EXPECT_EQ(tile.planes[2].data, image.planes[2].data + 3 * 32 + 5);
  image.format = PixelFormat::kRgb8;
  EXPECT_EQ(ViewOfTile(image, {10, 6, 20, 20}).planes[0].data, data.data() + 6 * 64 + 30);
}

TEST(MergeTileSegments, ALineOverASeamIsOneSegment) {
  const auto merged =
      MergeTileSegments(kTiles, {{Line(20, 50, 119, 50, 0.4)}, {Line(80, 51, 0, 50, 0.7)}}, 1.5);
  ASSERT_EQ(merged.size(), 1u);
  EXPECT_NEAR(std::abs(merged[0].Delta().x()), 160.0, 1e-9);
  EXPECT_EQ(merged[0].score, 0.7);
}

TEST(MergeTileSegments, ALineThatBothTilesSeeComesOnce) {
  const auto merged =
      MergeTileSegments(kTiles, {{Line(102, 20, 116, 80)}, {Line(2.5, 20, 16.5, 80)}}, 1.5);
  ASSERT_EQ(merged.size(), 1u);
}

TEST(MergeTileSegments, NeighboursStayApart) {
  // Parallel at 3 px, crossing, and one behind the other without a common part.
  EXPECT_EQ(MergeTileSegments(kTiles, {{Line(20, 50, 119, 50)}, {Line(0, 53, 80, 53)}}, 1.5).size(),
            2u);
  EXPECT_EQ(MergeTileSegments(kTiles, {{Line(20, 50, 119, 50)}, {Line(9, 0, 9, 99)}}, 1.5).size(),
            2u);
  EXPECT_EQ(MergeTileSegments(kTiles, {{Line(20, 50, 103, 50)}, {Line(8, 50, 90, 50)}}, 1.5).size(),
            2u);
}

TEST(MergeTileSegments, OfParallelLinesEachFindsItsOwn) {
  const auto merged = MergeTileSegments(kTiles,
                                        {{Line(20, 50, 119, 50), Line(20, 52, 119, 52)},
                                         {Line(0, 52.4, 80, 52.4), Line(0, 50.4, 80, 50.4)}},
                                        3.0);
  ASSERT_EQ(merged.size(), 2u);
  for (const Segment2& segment : merged) EXPECT_NEAR(std::abs(segment.Delta().x()), 160.0, 1e-9);
}

TEST(MergeTileSegments, BestScoreFirstAndTiesInOrder) {
  const auto merged = MergeTileSegments(
      kTiles, {{Line(1, 1, 50, 1, 0.2), Line(1, 9, 50, 9, 0.5)}, {Line(50, 20, 90, 20, 0.5)}}, 1.5);
  ASSERT_EQ(merged.size(), 3u);
  EXPECT_EQ(merged[0].start.y(), 9.0);
  EXPECT_EQ(merged[1].start, Eigen::Vector2d(150, 20));
  EXPECT_EQ(merged[2].score, 0.2);
}

Result<std::unique_ptr<LineDetector>> Tiled(TileGrid grid, SegmentSelection selection = {}) {
  return ConfigureDetector(CreateLsdDetector(), {selection, grid});
}

TEST(ConfiguredDetector, TilesFindTheSameRectangleAsTheWholeImage) {
  const SoftRectangle rectangle{{300, 200}, {220, 130}, 0.1};
  GrayImage image(600, 400);
  rectangle.Draw(&image);
  const auto detector = Tiled({3, 2});
  ASSERT_TRUE(detector);
  for (int repeat = 0; repeat < 2; ++repeat) {
    const auto found = (*detector)->Detect(image.View());
    ASSERT_TRUE(found);
    ASSERT_EQ(found->size(), 4u);  // every border crosses seams
    for (const Segment2& border : rectangle.Borders()) {
      int matches = 0;
      for (const Segment2& segment : *found) {
        if (DistanceFromLine(segment, border) > 1.0) continue;
        ++matches;
        EXPECT_NEAR(segment.Length(), border.Length(), 8.0);
      }
      EXPECT_EQ(matches, 1);
    }
  }
}

TEST(ConfiguredDetector, OneImageAtATime) {
  const GrayImage image(300, 200, 9);
  const auto detector = Tiled({2, 1});
  EXPECT_FALSE((*detector)->Collect());
  EXPECT_TRUE((*detector)->Submit(image.View()));
  EXPECT_FALSE((*detector)->Submit(image.View()));
  EXPECT_TRUE((*detector)->Collect());
  EXPECT_FALSE((*detector)->Submit(ImageView()));
  EXPECT_TRUE((*detector)->Detect(image.View()));
}

TEST(ConfiguredDetector, OptionsOutOfRangeAreRefused) {
  EXPECT_FALSE(Tiled({0, 2}));
  EXPECT_FALSE(Tiled({65, 1}));
  EXPECT_FALSE(Tiled({1, 1}, {.min_score = 1.5}));
  EXPECT_FALSE(Tiled({1, 1}, {.min_length_px = std::nan("")}));
  EXPECT_FALSE(Tiled({1, 1}, {.structural_nms = -1}));
  EXPECT_TRUE(Tiled({0, 0}));
}

TEST(SelectSegments, KeepsWhatIsBetterThanItsNeighbours) {
  const std::vector<Segment2> all = {Line(0, 0, 100, 0, 0.9), Line(100, 1, 0, 1, 0.8),
                                     Line(0, 9, 100, 9, 0.7), Line(0, 50, 5, 50, 0.6),
                                     Line(0, 80, 90, 80, 0.2)};
  const auto select = [&](const SegmentSelection& selection) {
    std::vector<Segment2> kept = all;
    SelectSegments(selection, 128, 128, &kept);
    std::vector<double> scores;
    for (const Segment2& segment : kept) scores.push_back(segment.score);
    return scores;
  };
  using Scores = std::vector<double>;
  EXPECT_EQ(select({}).size(), all.size());
  EXPECT_EQ(select({.min_score = 0.6}), (Scores{0.9, 0.8, 0.7, 0.6}));
  EXPECT_EQ(select({.min_length_px = 6}), (Scores{0.9, 0.8, 0.7, 0.2}));
  EXPECT_EQ(select({.structural_nms = 2}), (Scores{0.9, 0.7, 0.6, 0.2}));  // 2 itself goes
  EXPECT_EQ(select({.structural_nms = 1.9}).size(), all.size());
  EXPECT_EQ(select({.structural_nms = 2, .max_count = 2}), (Scores{0.9, 0.7}));
}

TEST(SelectSegments, StructuralNmsMeasuresInAGridOf128) {
  std::vector<Segment2> kept = {Line(0, 0, 1000, 0), Line(0, 9, 1000, 9)};
  SelectSegments({.structural_nms = 2}, 1280, 1280, &kept);  // 2 * 0.9^2
  EXPECT_EQ(kept.size(), 1u);
}

}  // namespace
}  // namespace plumb
