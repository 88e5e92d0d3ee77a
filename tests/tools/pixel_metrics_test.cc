// Pixel metrics against values computed by hand.
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tools/metrics/line_raster.h"
#include "tools/metrics/pixel_ap.h"
#include "tools/metrics/pixel_matcher.h"

namespace plumb::tools {
namespace {

Segment2 Line(double x1, double y1, double x2, double y2, double score = 1.0) {
  return {{x1, y1}, {x2, y2}, score};
}

std::vector<std::pair<int, int>> Pixels(const Segment2& line) {
  std::vector<Eigen::Vector2i> pixels;
  RasterizeLine(line, 100, 100, &pixels);
  std::vector<std::pair<int, int>> pairs;
  for (const Eigen::Vector2i& p : pixels) pairs.emplace_back(p.x(), p.y());
  return pairs;
}

using Pairs = std::vector<std::pair<int, int>>;

TEST(LineRaster, OnePixelAStepOfTheLongerAxis) {
  EXPECT_EQ(Pixels(Line(1, 2, 5, 4)), (Pairs{{1, 2}, {2, 3}, {3, 3}, {4, 4}, {5, 4}}));
  EXPECT_EQ(Pixels(Line(2, 1, 4, 5)), (Pairs{{2, 1}, {3, 2}, {3, 3}, {4, 4}, {4, 5}}));
  EXPECT_EQ(Pixels(Line(3, 3, 1, 1)), (Pairs{{3, 3}, {2, 2}, {1, 1}}));
}

TEST(LineRaster, EndsAreRoundedHalvesUp) {
  EXPECT_EQ(Pixels(Line(1.5, 1.49, 3.49, 0.5)), (Pairs{{2, 1}, {3, 1}}));
  EXPECT_EQ(Pixels(Line(7.2, 7.3, 6.9, 6.6)), (Pairs{{7, 7}}));
}

TEST(LineRaster, PixelsOutsideAreLeftOut) {
  EXPECT_EQ(Pixels(Line(-2, 0, 1, 0)), (Pairs{{0, 0}, {1, 0}}));
  EXPECT_TRUE(Pixels(Line(-20, -5, -4, 100)).empty());
  EXPECT_EQ(Pixels(Line(98, 50, 1e6, 50)), (Pairs{{98, 50}, {99, 50}}));
}

TEST(PixelMatcher, ReachIncludesItsEnd) {
  PixelMatcher near(20, 20, 5.0), far(20, 20, 4.99);
  for (PixelMatcher* matcher : {&near, &far}) {
    matcher->AddTarget({10, 10});
    matcher->AddCandidate({13, 14});
  }
  EXPECT_EQ(near.num_matches(), 1u);
  EXPECT_EQ(far.num_matches(), 0u);
}

TEST(PixelMatcher, EveryPixelCountsOnce) {
  PixelMatcher matcher(20, 20, 1.0);
  for (int i = 0; i < 3; ++i) matcher.AddTarget({4, 4});
  for (int i = 0; i < 3; ++i) matcher.AddCandidate({4, 4});
  EXPECT_EQ(matcher.num_targets(), 1u);
  EXPECT_EQ(matcher.num_candidates(), 1u);
  EXPECT_EQ(matcher.num_matches(), 1u);
}

TEST(PixelMatcher, EarlierMatchesMoveAsideForMore) {
  // Greedily, (5,5) takes (5,5) and (4,5) is left with nothing; (5,5) can move on to (6,5).
  PixelMatcher matcher(20, 20, 1.0);
  matcher.AddTarget({5, 5});
  matcher.AddTarget({6, 5});
  matcher.AddCandidate({5, 5});
  matcher.AddCandidate({4, 5});
  EXPECT_EQ(matcher.num_matches(), 2u);
}

TEST(PixelMatcher, CandidatesCrowdingOneTargetMatchOnce) {
  PixelMatcher matcher(20, 20, 2.0);
  matcher.AddTarget({5, 5});
  matcher.AddTarget({15, 15});
  for (int x = 4; x <= 6; ++x) matcher.AddCandidate({x, 5});
  EXPECT_EQ(matcher.num_matches(), 1u);
  matcher.AddCandidate({15, 14});  // a later one elsewhere is not held up by their failures
  EXPECT_EQ(matcher.num_matches(), 2u);
}

TEST(PixelMatcher, ShiftedLineMatchesAllButItsEnd) {
  // Targets x = 0..9, candidates x = 3..12 on the same row, reach 1: a chain of moves cannot help,
  // candidate 12 has no target and 11, 10 only 9 of which one is enough.
  PixelMatcher matcher(20, 20, 1.0);
  for (int x = 0; x < 10; ++x) matcher.AddTarget({x, 5});
  for (int x = 3; x < 13; ++x) matcher.AddCandidate({x, 5});
  EXPECT_EQ(matcher.num_matches(), 8u);  // candidates 3..10 with targets 2..9
}

TEST(EvaluatePixels, PerfectDetectionsScore100) {
  const std::vector<LineEvaluation> images{{100,
                                            80,
                                            {Line(10, 10, 60, 30, 0.9), Line(5, 70, 90, 70, 0.3)},
                                            {Line(60, 30, 10, 10), Line(5, 70, 90, 70)}}};
  const PixelScores scores = EvaluatePixels(images);
  EXPECT_DOUBLE_EQ(scores.f_percent, 100.0);
  EXPECT_DOUBLE_EQ(scores.ap_percent, 100.0);
}

TEST(EvaluatePixels, CountsPixelsPerThreshold) {
  // Diagonal 50, reach 0.5 px: only equal pixels match. Annotated: 20 pixels.
  // Score 0.9: 10 of them. Score 0.5: 10 pixels elsewhere and 5 more of the annotated ones.
  const std::vector<LineEvaluation> images{
      {40,
       30,
       {Line(0, 5, 9, 5, 0.9), Line(10, 5, 14, 5, 0.5), Line(0, 20, 9, 20, 0.5)},
       {Line(0, 5, 19, 5)}}};
  const PixelScores scores = EvaluatePixels(images);
  // Down to 0.5+: precision 1, recall 10/20, F 2/3. Below: precision 15/25, recall 15/20, F 2/3.
  EXPECT_NEAR(scores.f_percent, 100.0 * 2.0 / 3.0, 1e-9);
  EXPECT_NEAR(scores.ap_percent, 100.0 * (0.5 * 1.0 + 0.25 * 0.6), 1e-9);
}

TEST(EvaluatePixels, EnvelopeLiftsEarlierPrecision) {
  // The best score is a miss of 10 pixels, then 20 hits: precision 0, 20/30; recall 0, 1.
  const std::vector<LineEvaluation> images{
      {40, 30, {Line(0, 25, 9, 25, 0.9), Line(0, 5, 19, 5, 0.4)}, {Line(0, 5, 19, 5)}}};
  const PixelScores scores = EvaluatePixels(images);
  EXPECT_NEAR(scores.ap_percent, 100.0 * 2.0 / 3.0, 1e-9);
  EXPECT_NEAR(scores.f_percent, 80.0, 1e-9);  // 2 * 2/3 / (5/3)
}

TEST(EvaluatePixels, ReachIsOnePercentOfTheDiagonal) {
  // 300 x 400: 5 px. A parallel line 5 px off matches in full, one 6 px off not at all.
  const LineEvaluation near{300, 400, {Line(50, 105, 150, 105)}, {Line(50, 100, 150, 100)}};
  const LineEvaluation far{300, 400, {Line(50, 106, 150, 106)}, {Line(50, 100, 150, 100)}};
  EXPECT_DOUBLE_EQ(EvaluatePixels({&near, 1}).f_percent, 100.0);
  EXPECT_DOUBLE_EQ(EvaluatePixels({&far, 1}).f_percent, 0.0);
}

TEST(EvaluatePixels, SumsOverImages) {
  // One image is perfect, the other one detects nothing: recall 1/2 at precision 1.
  const std::vector<LineEvaluation> images{
      {100, 80, {Line(10, 10, 30, 10)}, {Line(10, 10, 30, 10)}},
      {100, 80, {}, {Line(10, 10, 30, 10)}}};
  const PixelScores scores = EvaluatePixels(images);
  EXPECT_NEAR(scores.ap_percent, 50.0, 1e-9);
  EXPECT_NEAR(scores.f_percent, 100.0 * 2.0 / 3.0, 1e-9);
}

TEST(EvaluatePixels, NothingAnnotatedOrDetectedIsZero) {
  for (const LineEvaluation& image :
       {LineEvaluation{100, 80, {}, {}}, LineEvaluation{100, 80, {Line(1, 1, 9, 9)}, {}},
        LineEvaluation{100, 80, {}, {Line(1, 1, 9, 9)}}}) {
    const PixelScores scores = EvaluatePixels({&image, 1});
    EXPECT_DOUBLE_EQ(scores.f_percent, 0.0);
    EXPECT_DOUBLE_EQ(scores.ap_percent, 0.0);
  }
}

TEST(StructuralCurve, CountsTheHitsAboveEachScore) {
  const std::vector<LineEvaluation> images{
      {128,
       128,
       {Line(0, 0, 10, 0, 0.9), Line(0, 90, 10, 99, 0.6), Line(0, 50, 10, 52, 0.3)},
       {Line(0, 0, 10, 0), Line(0, 50, 10, 50)}}};
  const std::vector<OperatingPoint> curve = StructuralCurve(images, 5.0);
  ASSERT_EQ(curve.size(), 101u);
  EXPECT_DOUBLE_EQ(curve[95].precision, 1.0);  // nothing is left
  EXPECT_DOUBLE_EQ(curve[95].recall, 0.0);
  EXPECT_DOUBLE_EQ(curve[90].precision, 1.0);  // the score itself is kept
  EXPECT_DOUBLE_EQ(curve[90].recall, 0.5);
  EXPECT_DOUBLE_EQ(curve[50].precision, 0.5);
  EXPECT_DOUBLE_EQ(curve[0].precision, 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(curve[0].recall, 1.0);
  EXPECT_DOUBLE_EQ(curve[0].f, 0.8);
}

}  // namespace
}  // namespace plumb::tools
