#include "plumb/matching/segment_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include "support/allocation_counter.h"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr float kPi = std::numbers::pi_v<float>;

std::vector<Segment2> RandomSegments(size_t count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> at(0.0, 600.0);
  std::vector<Segment2> segments;
  for (size_t i = 0; i < count; ++i) {
    segments.push_back({{at(rng), at(rng)}, {at(rng), at(rng)}});
  }
  return segments;
}

Segment2 AtDegrees(double degrees) {
  const double angle = degrees * std::numbers::pi / 180.0;
  return {{100.0, 100.0}, {100.0 + 50.0 * std::cos(angle), 100.0 + 50.0 * std::sin(angle)}};
}

std::set<uint32_t> Rows(const std::array<SegmentTable::Range, 2>& ranges) {
  std::set<uint32_t> rows;
  for (const auto& range : ranges) {
    for (uint32_t row = range.begin; row < range.end; ++row) {
      EXPECT_TRUE(rows.insert(row).second) << "row " << row << " twice";
    }
  }
  return rows;
}

TEST(SegmentTable, HoldsTheSegmentsInOrderOfTheirAngle) {
  const auto segments = RandomSegments(300, /*seed=*/1);
  SegmentTable table;
  table.Assign(segments);
  ASSERT_EQ(table.size(), segments.size());
  for (size_t row = 0; row < table.size(); ++row) {
    const Segment2& segment = segments[table.source[row]];
    EXPECT_EQ(table.x0[row], static_cast<float>(segment.start.x()));
    EXPECT_EQ(table.y1[row], static_cast<float>(segment.end.y()));
    EXPECT_NEAR(table.length[row], segment.Length(), 1e-3);
    EXPECT_NEAR(table.direction_x[row] * table.length[row], segment.Delta().x(), 1e-3);
    EXPECT_NEAR(table.direction_y[row] * table.length[row], segment.Delta().y(), 1e-3);
    EXPECT_GE(table.angle[row], 0.0f);
    EXPECT_LT(table.angle[row], kPi);
    EXPECT_LE(table.angle[row == 0 ? 0 : row - 1], table.angle[row]);
  }
}

TEST(SegmentTable, KeepsTheOrderOfEqualAngles) {
  SegmentTable table;
  table.Assign(std::vector<Segment2>{AtDegrees(90), AtDegrees(45), AtDegrees(90), AtDegrees(45)});
  EXPECT_THAT(table.source, ElementsAre(1u, 3u, 0u, 2u));
}

TEST(SegmentTable, GivesBothDirectionsTheSameAngle) {
  SegmentTable table;
  table.Assign(std::vector<Segment2>{{{0, 0}, {10, 0}}, {{10, 0}, {0, 0}}, {{10, 0}, {0, -1e-18}}});
  EXPECT_THAT(table.angle, ElementsAre(0.0f, 0.0f, 0.0f));
}

TEST(SegmentTable, LeavesOutSegmentsWithoutLength) {
  SegmentTable table;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  table.Assign(std::vector<Segment2>{{{5, 5}, {5, 5}}, AtDegrees(10), {{nan, 0}, {1, 1}}});
  EXPECT_THAT(table.source, ElementsAre(1u));
  EXPECT_EQ(table.angle.size(), 1u);
}

TEST(SegmentTable, ForgetsWhatItHeldBefore) {
  SegmentTable table;
  table.Assign(RandomSegments(20, /*seed=*/2));
  table.Assign(std::vector<Segment2>{AtDegrees(30)});
  EXPECT_EQ(table.size(), 1u);
  EXPECT_EQ(table.angle.size(), 1u);
  EXPECT_EQ(table.x0.size(), 1u + SegmentTable::kLanes);
  table.Assign({});
  EXPECT_EQ(table.size(), 0u);
  EXPECT_THAT(Rows(table.NearAngle(1.0f, 0.5f)), IsEmpty());
}

TEST(SegmentTable, DoesNotAllocateOnceWarm) {
  const auto segments = RandomSegments(200, /*seed=*/3);
  SegmentTable table;
  table.Assign(segments);
  const size_t before = testing::num_allocations;
  for (int i = 0; i < 10; ++i) table.Assign(segments);
  EXPECT_EQ(testing::num_allocations, before);
}

TEST(NearAngle, MissesNoRowAndTakesFewTooMany) {
  SegmentTable table;
  table.Assign(RandomSegments(500, /*seed=*/4));
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> angle(0.0f, kPi), sine(0.01f, 0.99f);
  for (int trial = 0; trial < 500; ++trial) {
    // The borders of the interval too, where the angles wrap around.
    const float around = trial == 0 ? 0.0f : trial == 1 ? std::nextafter(kPi, 0.0f) : angle(rng);
    const float max_sine = sine(rng);
    const auto rows = Rows(table.NearAngle(around, max_sine));
    for (uint32_t row = 0; row < table.size(); ++row) {
      const double between = std::abs(std::sin(static_cast<double>(table.angle[row]) - around));
      if (between <= max_sine) {
        ASSERT_TRUE(rows.contains(row)) << around << " " << max_sine;
      } else if (between > max_sine + 2e-3 + kPi / 512.0) {
        ASSERT_FALSE(rows.contains(row)) << around << " " << max_sine;
      }
    }
  }
}

TEST(NearAngle, WrapsAround) {
  SegmentTable table;
  table.Assign(std::vector<Segment2>{AtDegrees(1), AtDegrees(90), AtDegrees(179)});
  const float half_degree = kPi / 360.0f, sine = std::sin(kPi / 60.0f);  // 3 degrees
  EXPECT_THAT(Rows(table.NearAngle(half_degree, sine)), ElementsAre(0u, 2u));
  EXPECT_THAT(Rows(table.NearAngle(kPi - half_degree, sine)), ElementsAre(0u, 2u));
  EXPECT_THAT(Rows(table.NearAngle(0.5f * kPi, sine)), ElementsAre(1u));
}

TEST(NearAngle, IsEverythingWhereEveryAngleIsAllowed) {
  SegmentTable table;
  table.Assign(RandomSegments(50, /*seed=*/6));
  EXPECT_EQ(Rows(table.NearAngle(1.0f, 1.0f)).size(), 50u);
  EXPECT_EQ(Rows(table.NearAngle(1.0f, 7.0f)).size(), 50u);
}

}  // namespace
}  // namespace plumb
