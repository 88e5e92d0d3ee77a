#include "plumb/search/direction_field.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "support/synthetic_room.h"

namespace plumb {
namespace {

constexpr double kPi = std::numbers::pi;

Segment2 AtAngle(double angle, const Eigen::Vector2d& middle, double half) {
  const Eigen::Vector2d d = half * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  return {middle - d, middle + d};
}

/// Distance of a point to a segment.
double Distance(const Segment2& segment, const Eigen::Vector2d& p) {
  const Eigen::Vector2d d = segment.Delta();
  const double u = std::clamp((p - segment.start).dot(d) / d.squaredNorm(), 0.0, 1.0);
  return (segment.start + u * d - p).norm();
}

TEST(DirectionField, EqualsTheChamferMetricByBruteForce) {
  Random random(5);
  std::vector<Segment2> segments;
  const Camera camera{100, 100, 48, 36, 97, 71};
  for (int i = 0; i < 12; ++i) segments.push_back(testing::RandomSegment(camera, &random));
  for (const int cell : {1, 2, 4}) {
    DirectionField field;
    field.Assign(camera.width_px, camera.height_px, segments, {cell, 0.2});
    const int truncated = 200 / cell;
    for (int channel = 0; channel < DirectionField::kChannels; channel += 3) {
      std::vector<std::pair<int, int>> drawn;
      for (int r = 0; r < field.height(); ++r) {
        for (int c = 0; c < field.width(); ++c) {
          if (field.At(r, c, channel) == 0.0f) drawn.emplace_back(r, c);
        }
      }
      for (int r = 0; r < field.height(); r += 3) {
        for (int c = 0; c < field.width(); c += 3) {
          int expected = truncated;
          for (const auto& [dr, dc] : drawn) {
            const int a = std::abs(r - dr), b = std::abs(c - dc);
            expected = std::min(expected, 5 * std::max(a, b) + 2 * std::min(a, b));
          }
          ASSERT_FLOAT_EQ(field.At(r, c, channel), field.unit_px() * static_cast<float>(expected))
              << "cell " << cell << " channel " << channel << " at " << r << ", " << c;
        }
      }
    }
  }
}

TEST(DirectionField, IsNearTheEuclideanDistance) {
  const Segment2 segment = AtAngle(0.4, {80, 60}, 40);
  const int channel = static_cast<int>(0.4 / kPi * DirectionField::kChannels);
  DirectionField field;
  field.Assign(160, 120, std::span(&segment, 1), {2, 0.2});
  for (int r = 0; r < field.height(); ++r) {
    for (int c = 0; c < field.width(); ++c) {
      const Eigen::Vector2d pixel(2.0 * (c - field.border_cells()),
                                  2.0 * (r - field.border_cells()));
      const double exact =
          std::min<double>(Distance(segment, pixel), DirectionField::kTruncationPx);
      // 8 % from the chamfer weights, 1.5 px from the cells.
      ASSERT_NEAR(field.At(r, c, channel), exact, 0.08 * exact + 1.5) << pixel.transpose();
    }
  }
}

TEST(DirectionField, SegmentsAreInTheChannelsOfTheirOrientation) {
  for (int channel = 0; channel < DirectionField::kChannels; ++channel) {
    const Segment2 segment =
        AtAngle((channel + 0.5) * kPi / DirectionField::kChannels, {50, 50}, 30);
    DirectionField field;
    field.Assign(100, 100, std::span(&segment, 1), {2, 10.0 * kPi / 180});
    const int at = 25 + field.border_cells();
    for (int other = 0; other < DirectionField::kChannels; ++other) {
      const bool is_own = other == channel;  // neighbouring centres are 11.25 deg away
      EXPECT_EQ(field.At(at, at, other) == 0.0f, is_own) << channel << " in " << other;
      if (!is_own) {
        EXPECT_FLOAT_EQ(field.At(at, at, other), 40.0f);
      }
    }
  }
}

TEST(DirectionField, WiderToleranceReachesTheNeighbouringChannels) {
  const Segment2 segment = AtAngle(0.5 * kPi / DirectionField::kChannels, {50, 50}, 30);
  DirectionField field;
  field.Assign(100, 100, std::span(&segment, 1), {4, 15.0 * kPi / 180});
  const int row = 12 + field.border_cells();
  for (const int channel : {15, 0, 1}) EXPECT_LE(field.At(row, row, channel), 4.0f);
  for (const int channel : {2, 8, 14}) EXPECT_FLOAT_EQ(field.At(row, row, channel), 40.0f);
}

TEST(DirectionField, OrderOfTheEndPointsCarriesNoMeaning) {
  const Segment2 forward{{12.3, 70.9}, {66.1, 20.2}};
  const Segment2 backward{forward.end, forward.start};
  DirectionField a, b;
  a.Assign(100, 90, std::span(&forward, 1), {2, 0.2});
  b.Assign(100, 90, std::span(&backward, 1), {2, 0.2});
  int differing = 0;  // Rounding may put single cells of the drawn line elsewhere.
  for (int r = 0; r < a.height(); ++r) {
    for (int c = 0; c < a.width(); ++c) {
      for (int k = 0; k < DirectionField::kChannels; ++k) {
        differing += std::abs(a.At(r, c, k) - b.At(r, c, k)) > 2.0f ? 1 : 0;
      }
    }
  }
  EXPECT_EQ(differing, 0);
}

TEST(DirectionField, SegmentsOutsideOfTheImageAreHarmless) {
  const std::vector<Segment2> segments = {
      {{-5000, -5000}, {-4000, -4000}}, {{-50, 30}, {1e5, 30}}, {{40, 40}, {40, 40}}};
  DirectionField field;
  field.Assign(64, 48, segments, {2, 0.2});
  const int border = field.border_cells();
  EXPECT_EQ(field.width(), 32 + 2 * border);
  EXPECT_EQ(field.At(15 + border, 10 + border, 0), 0.0f);  // the line that crosses the image
}

TEST(DirectionField, WithoutSegmentsEverythingIsFar) {
  DirectionField field;
  field.Assign(33, 21, {}, {4, 0.2});
  for (int r = 0; r < field.height(); ++r) {
    for (int c = 0; c < field.width(); ++c) ASSERT_FLOAT_EQ(field.At(r, c, 7), 40.0f);
  }
}

TEST(DirectionField, ASecondImageLeavesNothingOfTheFirst) {
  const Segment2 first{{10, 10}, {80, 60}}, second{{70, 5}, {20, 64}};
  DirectionField reused, fresh;
  reused.Assign(100, 80, std::span(&first, 1), {2, 0.2});
  reused.Assign(90, 70, std::span(&second, 1), {2, 0.2});
  fresh.Assign(90, 70, std::span(&second, 1), {2, 0.2});
  const size_t bytes = static_cast<size_t>(fresh.width()) * fresh.height() * 16;
  ASSERT_EQ(reused.width(), fresh.width());
  EXPECT_TRUE(std::equal(fresh.data(), fresh.data() + bytes, reused.data()));
}

}  // namespace
}  // namespace plumb
