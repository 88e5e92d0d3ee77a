// Segments against edges that are known exactly, and the vectorised code against a plain one.
#include "plumb/features/segment_ridge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "support/edge_image.h"

namespace plumb {
namespace {

using testing::DistanceFromLine;
using testing::GrayImage;
using testing::SoftRectangle;

BlurredImage Blur(const GrayImage& image) {
  BlurredImage blurred;
  blurred.Assign(image.Gray());
  return blurred;
}

// `segment` moved by `offset_px` and turned by `angle_rad` about its middle, ends cut by 10 %.
Segment2 Displace(const Segment2& segment, double offset_px, double angle_rad) {
  const Eigen::Vector2d half = 0.4 * segment.Delta();
  const Eigen::Vector2d unit = segment.Delta().normalized();
  const Eigen::Vector2d middle =
      segment.Midpoint() + offset_px * Eigen::Vector2d(-unit.y(), unit.x());
  const double c = std::cos(angle_rad), s = std::sin(angle_rad);
  const Eigen::Vector2d turned(c * half.x() - s * half.y(), s * half.x() + c * half.y());
  return {middle - turned, middle + turned};
}

// The recipe written down once more, a loop a line, in double.
bool PlainMoveToRidge(const BlurredImage& image, double half, Segment2* segment) {
  constexpr int kProfiles = 24;
  const Eigen::Vector2d delta = segment->Delta(), unit = delta.normalized();
  const Eigen::Vector2d normal(-unit.y(), unit.x());
  const auto sample = [&](const Eigen::Vector2d& p) {
    const double x = std::clamp(p.x(), 0.0, image.width_px() - 1.0);
    const double y = std::clamp(p.y(), 0.0, image.height_px() - 1.0);
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const double fx = x - ix, fy = y - iy;
    return (1 - fy) * ((1 - fx) * image.At(ix, iy) + fx * image.At(ix + 1, iy)) +
           fy * ((1 - fx) * image.At(ix, iy + 1) + fx * image.At(ix + 1, iy + 1));
  };
  std::vector<double> offsets;
  for (double o = -half; o < half + 0.1; o += 0.5) offsets.push_back(o);
  const int n = static_cast<int>(offsets.size());
  std::vector<std::array<double, kProfiles>> g(offsets.size());
  for (size_t k = 0; k < g.size(); ++k) {
    for (size_t i = 0; i < kProfiles; ++i) {
      const Eigen::Vector2d p = segment->start + (static_cast<double>(i) + 0.5) / kProfiles * delta;
      g[k][i] = sample(p + (offsets[k] + 0.5) * normal) - sample(p + (offsets[k] - 0.5) * normal);
    }
  }
  size_t dominant = 0;
  double strongest = 0.0;
  for (size_t k = 0; k < g.size(); ++k) {
    double mean = 0.0;
    for (const double value : g[k]) mean += value / kProfiles;
    mean *= std::exp(-0.5 * std::pow(offsets[k] / (0.6 * half), 2));
    if (std::abs(mean) > std::abs(strongest)) strongest = mean, dominant = k;
  }
  if (strongest == 0.0) return false;
  std::array<double, kProfiles> offset{}, weight{}, current{};
  for (size_t i = 0; i < kProfiles; ++i) {
    std::vector<double> r;
    for (size_t k = 0; k < g.size(); ++k) {
      r.push_back(std::max(0.0, g[k][i] * (strongest > 0.0 ? 1.0 : -1.0)) *
                  std::exp(-0.5 * std::pow((offsets[k] - offsets[dominant]) / 1.5, 2)));
    }
    const int best = static_cast<int>(std::max_element(r.begin(), r.end()) - r.begin());
    const size_t j = static_cast<size_t>(std::clamp(best, 1, n - 2));
    const double a = r[j - 1], b = r[j], c = r[j + 1];
    offset[i] =
        offsets[j] + 0.5 * std::clamp(0.5 * (a - c) / std::min(a - 2 * b + c, -1e-6), -1.0, 1.0);
    weight[i] = current[i] = b > 1.0 ? std::min(b, 30.0) : 0.0;
  }
  double at_middle = 0.0, slope = 0.0, total = 0.0, left = 0.0;
  for (int iteration = 0; iteration < 4; ++iteration) {
    double s0 = 1e-9, s1 = 0, s2 = 0, t0 = 0, t1 = 0;
    for (size_t i = 0; i < kProfiles; ++i) {
      const double u = (static_cast<double>(i) + 0.5) / kProfiles - 0.5, w = current[i];
      s0 += w, s1 += w * u, s2 += w * u * u, t0 += w * offset[i], t1 += w * u * offset[i];
    }
    const double det = s0 * s2 - s1 * s1 + 1e-9;
    at_middle = (s2 * t0 - s1 * t1) / det;
    slope = (s0 * t1 - s1 * t0) / det;
    total = left = 0.0;
    for (size_t i = 0; i < kProfiles; ++i) {
      const double u = (static_cast<double>(i) + 0.5) / kProfiles - 0.5;
      const double r = (offset[i] - at_middle - slope * u) / 0.4;
      current[i] = weight[i] / std::pow(1.0 + r * r, 2);
      total += weight[i];
      left += current[i];
    }
  }
  if (!(std::abs(at_middle) < half && std::abs(slope) < half && total > 0 && left > 0.25 * total)) {
    return false;
  }
  segment->start += (at_middle - 0.5 * slope) * normal;
  segment->end += (at_middle + 0.5 * slope) * normal;
  return true;
}

// One pass leaves up to 0.3 px, since it weighs the peaks around a multiple of 0.5 px; the three of
// SegmentRefiner converge.
TEST(MoveToRidge, FindsTheEdgeFromTwoPixelsAwayAtAnyAngle) {
  for (int degrees = 0; degrees < 180; degrees += 15) {
    SoftRectangle rectangle{{80.3, 75.7}, {45.0, 35.0}};
    rectangle.angle_rad = degrees * std::numbers::pi / 180.0;
    GrayImage image(160, 150);
    rectangle.Draw(&image);
    const BlurredImage blurred = Blur(image);
    for (const Segment2& border : rectangle.Borders()) {
      for (const double offset : {-2.0, -0.7, 0.0, 1.3, 2.0}) {
        Segment2 segment = Displace(border, offset, 0.02);
        EXPECT_TRUE(MoveToRidge(blurred, kWideHalfWidthPx, &segment));
        MoveToRidge(blurred, kNarrowHalfWidthPx, &segment);
        MoveToRidge(blurred, kNarrowHalfWidthPx, &segment);
        EXPECT_LT(DistanceFromLine(segment, border), 0.25) << degrees << " deg, " << offset;
      }
    }
  }
}

TEST(MoveToRidge, WorksForBothPolarities) {
  for (const double inside : {30.0, 220.0}) {
    SoftRectangle rectangle{{60, 60}, {30, 25}};
    rectangle.outside = 120.0;
    rectangle.inside = inside;
    GrayImage image(120, 120);
    rectangle.Draw(&image);
    Segment2 segment = Displace(rectangle.Borders()[0], 0.2, 0.0);
    EXPECT_TRUE(MoveToRidge(Blur(image), kWideHalfWidthPx, &segment));
    EXPECT_LT(DistanceFromLine(segment, rectangle.Borders()[0]), 0.1);
  }
}

TEST(MoveToRidge, TheOrderOfTheEndsDoesNotMatter) {
  SoftRectangle rectangle{{60, 60}, {30, 25}, 0.4};
  GrayImage image(120, 120);
  rectangle.Draw(&image);
  const BlurredImage blurred = Blur(image);
  Segment2 forward = Displace(rectangle.Borders()[1], 1.5, 0.01);
  Segment2 backward{forward.end, forward.start};
  ASSERT_TRUE(MoveToRidge(blurred, kWideHalfWidthPx, &forward));
  ASSERT_TRUE(MoveToRidge(blurred, kWideHalfWidthPx, &backward));
  EXPECT_LT((forward.start - backward.end).norm(), 1e-3);
  EXPECT_LT((forward.end - backward.start).norm(), 1e-3);
}

TEST(MoveToRidge, LeavesSegmentsOfAFlatImageAlone) {
  const GrayImage image(50, 50, 90);
  Segment2 segment{{10, 10}, {40, 30}};
  EXPECT_FALSE(MoveToRidge(Blur(image), kWideHalfWidthPx, &segment));
  EXPECT_EQ(segment.start, Eigen::Vector2d(10, 10));
  EXPECT_EQ(segment.end, Eigen::Vector2d(40, 30));
}

TEST(MoveToRidge, LeavesSegmentsFarFromEveryEdgeAlone) {
  SoftRectangle rectangle{{60, 60}, {40, 40}};
  GrayImage image(120, 120);
  rectangle.Draw(&image);
  Segment2 segment{{40, 60}, {80, 60}};
  EXPECT_FALSE(MoveToRidge(Blur(image), kWideHalfWidthPx, &segment));
  EXPECT_EQ(segment.start, Eigen::Vector2d(40, 60));
}

TEST(MoveToRidge, AMinorityOfOtherEdgesDoesNotPullTheLine) {
  SoftRectangle rectangle{{60, 60}, {40, 25}};
  GrayImage image(120, 120);
  rectangle.Draw(&image);
  // A notch of the same polarity, 2 px beside the edge, over a quarter of its length.
  for (int y = 33; y < 35; ++y) {
    for (int x = 85; x < 100; ++x) image.At(x, y) = 200;
  }
  Segment2 segment = Displace(rectangle.Borders()[0], 0.8, 0.0);
  const BlurredImage blurred = Blur(image);
  EXPECT_TRUE(MoveToRidge(blurred, kWideHalfWidthPx, &segment));
  MoveToRidge(blurred, kNarrowHalfWidthPx, &segment);
  EXPECT_LT(DistanceFromLine(segment, rectangle.Borders()[0]), 0.25);
}

TEST(MoveToRidge, SegmentsMayLeaveTheImage) {
  SoftRectangle rectangle{{10, 30}, {40, 15}};
  GrayImage image(40, 60);
  rectangle.Draw(&image);
  Segment2 segment{{-30, 45.2}, {70, 45.2}};
  EXPECT_TRUE(MoveToRidge(Blur(image), kWideHalfWidthPx, &segment));
  EXPECT_LT(DistanceFromLine(segment, {{0, 45}, {1, 45}}), 0.1);
  const BlurredImage tiny = Blur(GrayImage(1, 1, 7));
  EXPECT_FALSE(MoveToRidge(tiny, kWideHalfWidthPx, &segment));
}

TEST(MoveToRidge, AgreesWithThePlainRecipeOnTexture) {
  std::mt19937 random(3);
  GrayImage image(160, 120);
  for (uint8_t& pixel : image.pixels) pixel = static_cast<uint8_t>(random() & 255u);
  const BlurredImage noise = Blur(image);
  SoftRectangle rectangle{{80, 60}, {50, 35}, 0.5};
  rectangle.Draw(&image);
  for (uint8_t& pixel : image.pixels) {
    pixel = static_cast<uint8_t>(std::min<uint64_t>(255, pixel + (random() & 31u)));
  }
  const BlurredImage edges = Blur(image);
  std::uniform_real_distribution<double> x(5.0, 155.0), y(5.0, 115.0);
  int num_moved = 0, num_compared = 0, num_different = 0;
  for (const BlurredImage* blurred : {&noise, &edges}) {
    for (int i = 0; i < 300; ++i) {
      Segment2 fast{{x(random), y(random)}, {x(random), y(random)}};
      if (fast.Length() < 12.0) continue;
      Segment2 plain = fast;
      const double half = i % 2 == 0 ? kWideHalfWidthPx : kNarrowHalfWidthPx;
      const bool moved = PlainMoveToRidge(*blurred, half, &plain);
      // Single precision may decide a tie of the dominant edge, or of the acceptance, differently.
      const bool agrees = MoveToRidge(*blurred, half, &fast) == moved &&
                          (fast.start - plain.start).norm() < 0.02 &&
                          (fast.end - plain.end).norm() < 0.02;
      num_different += agrees ? 0 : 1;
      num_moved += moved ? 1 : 0;
      ++num_compared;
    }
  }
  EXPECT_GT(num_moved, num_compared / 4);
  EXPECT_LT(num_different, num_compared / 50);
}

TEST(TrimToEdge, CutsASegmentThatReachesPastItsEdge) {
  SoftRectangle rectangle{{80, 60}, {40, 30}};
  GrayImage image(160, 120);
  rectangle.Draw(&image);
  // The top edge ends at x = 40 and x = 120.
  Segment2 segment{{40, 30}, {150, 30}};
  ASSERT_TRUE(TrimToEdge(Blur(image), &segment));
  EXPECT_NEAR(segment.start.x(), 40.0, 110.0 / 32);
  EXPECT_NEAR(segment.end.x(), 120.0, 110.0 / 32);
  EXPECT_DOUBLE_EQ(segment.start.y(), 30.0);
}

TEST(TrimToEdge, KeepsASegmentThatIsEdgeAllAlong) {
  SoftRectangle rectangle{{80, 60}, {60, 30}};
  GrayImage image(160, 120);
  rectangle.Draw(&image);
  Segment2 segment{{30, 30}, {130, 30}};
  ASSERT_TRUE(TrimToEdge(Blur(image), &segment));
  EXPECT_DOUBLE_EQ(segment.start.x(), 30.0);
  EXPECT_DOUBLE_EQ(segment.end.x(), 130.0);
}

TEST(TrimToEdge, RefusesASegmentOfWhichHalfHasNoEdge) {
  SoftRectangle rectangle{{40, 60}, {30, 30}};
  GrayImage image(200, 120);
  rectangle.Draw(&image);
  Segment2 segment{{20, 30}, {180, 30}};
  EXPECT_FALSE(TrimToEdge(Blur(image), &segment));
  EXPECT_DOUBLE_EQ(segment.end.x(), 180.0);
  const GrayImage flat(50, 50, 10);
  EXPECT_FALSE(TrimToEdge(Blur(flat), &segment));
}

TEST(TrimToEdge, RefusesAWeakEdge) {
  SoftRectangle rectangle{{80, 60}, {60, 30}};
  rectangle.outside = 100.0;
  rectangle.inside = 103.0;  // about 1.1 grey levels a pixel after the blur
  GrayImage image(160, 120);
  rectangle.Draw(&image);
  Segment2 segment{{30, 30}, {130, 30}};
  EXPECT_FALSE(TrimToEdge(Blur(image), &segment));
}

TEST(TrimToEdge, RefusesASegmentBesideTheEdge) {
  SoftRectangle rectangle{{80, 60}, {60, 30}};
  GrayImage image(160, 120);
  rectangle.Draw(&image);
  Segment2 segment{{30, 31.2}, {130, 31.2}};
  EXPECT_FALSE(TrimToEdge(Blur(image), &segment));
}

TEST(TrimToEdge, BridgesShortGapsButNotLongOnes) {
  const auto trimmed_length = [](int gap_px) {
    SoftRectangle rectangle{{100, 60}, {90, 30}};
    GrayImage image(200, 120);
    rectangle.Draw(&image);
    // No edge between x = 120 and x = 120 + gap: the inside reaches up to the border there.
    for (int y = 0; y < 60; ++y) {
      for (int x = 120; x < 120 + gap_px; ++x) image.At(x, y) = 200;
    }
    Segment2 segment{{20, 30}, {180, 30}};  // samples are 5 px apart
    EXPECT_TRUE(TrimToEdge(Blur(image), &segment));
    return segment.Length();
  };
  EXPECT_NEAR(trimmed_length(9), 160.0, 1e-9);
  EXPECT_NEAR(trimmed_length(30), 100.0, 6.0);
}

/// Rows above y = 80 have the level `above`, three rows `bar`, rows below `below`.
GrayImage Bar(uint8_t above, uint8_t bar, uint8_t below) {
  GrayImage image(200, 160, below);
  for (int y = 0; y < 83; ++y) {
    for (int x = 0; x < 200; ++x) image.At(x, y) = y < 80 ? above : bar;
  }
  return image;
}

/// The other border of a segment on the bar's upper border.
std::optional<Segment2> OtherBorder(const GrayImage& image) {
  const Segment2 upper{{50, 79.5}, {150, 79.5}, 0.8};
  Segment2 other;
  if (!FindOtherBorder(Blur(image), upper, &other)) return std::nullopt;
  return other;
}

TEST(FindOtherBorder, OfABarIsFoundWhateverItsPolarity) {
  for (const GrayImage& image : {Bar(50, 150, 50), Bar(150, 50, 150), Bar(50, 150, 80)}) {
    const std::optional<Segment2> other = OtherBorder(image);
    ASSERT_TRUE(other);
    EXPECT_NEAR(other->start.y(), 82.5, 0.6);
    EXPECT_NEAR(other->end.y(), 82.5, 0.6);
    EXPECT_EQ(other->start.x(), 50.0);
    EXPECT_EQ(other->score, 0.8);
  }
}

TEST(FindOtherBorder, StepsAndStairsHaveNone) {
  EXPECT_FALSE(OtherBorder(Bar(50, 150, 150)));  // one edge
  EXPECT_FALSE(OtherBorder(Bar(50, 100, 150)));  // two of the same polarity
  EXPECT_FALSE(OtherBorder(Bar(50, 150, 110)));  // 0.4 as strong
  EXPECT_FALSE(OtherBorder(Bar(50, 53, 50)));    // hardly there
}

}  // namespace
}  // namespace plumb
