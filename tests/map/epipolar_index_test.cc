// The index over epipolar half-planes finds what a look at every segment finds.
#include "plumb/map/epipolar_index.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/geometry/rigid3.h"
#include "plumb/search/random.h"

namespace plumb {
namespace {

using Interval = EpipolarPencil::Interval;
constexpr double kPi = std::numbers::pi;

double Between(Random* random, double low, double high) {
  return low + (high - low) * static_cast<double>(random->Uniform());
}

// On the circle, by the distance of the middles.
bool Overlap(const Interval& a, const Interval& b) {
  const double distance =
      std::remainder(0.5 * (a.low + a.high) - 0.5 * (b.low + b.high), 2.0 * kPi);
  return std::abs(distance) <= 0.5 * (a.high - a.low + b.high - b.low);
}

TEST(EpipolarIndex, FindsWhatOverlapsOnceEach) {
  Random random(5);
  std::vector<std::optional<Interval>> intervals;
  for (int k = 0; k < 300; ++k) {
    if (k % 17 == 0) {
      intervals.emplace_back();
      continue;
    }
    const double low = Between(&random, -kPi, kPi), width = k % 11 == 0 ? 3.0 : 0.1;
    intervals.push_back(Interval{low, low + Between(&random, 0.0, width)});
  }
  const EpipolarIndex index(intervals);
  std::vector<uint32_t> found;
  for (int query = 0; query < 300; ++query) {
    const double low = Between(&random, -kPi, kPi);
    const Interval interval{low, low + Between(&random, 0.0, query % 5 == 0 ? 3.0 : 0.2)};
    std::vector<uint32_t> expected;
    for (uint32_t k = 0; k < intervals.size(); ++k) {
      if (intervals[k] && Overlap(*intervals[k], interval)) expected.push_back(k);
    }
    index.Find(interval, &found);
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, expected) << "query " << query;
  }
}

TEST(EpipolarPencil, BothViewsSeeAPointInOneHalfPlane) {
  Random random(6);
  const auto anywhere = [&random] { return random.Normal3(1.0f).cast<double>().eval(); };
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d baseline = anywhere(), a = anywhere(), b = anywhere();
    const EpipolarPencil pencil(baseline);
    const auto own = pencil.Span(a, b), other = pencil.Span(a - baseline, b - baseline);
    if (!own || !other) continue;
    EXPECT_NEAR(own->low, other->low, 1e-9);
    EXPECT_NEAR(own->high, other->high, 1e-9);
    EXPECT_LE(own->high - own->low, kPi + 1e-9);
  }
}

TEST(EpipolarPencil, ASegmentAtTheEpipoleHasNoSpan) {
  const EpipolarPencil pencil({0.0, 0.0, 2.0});
  EXPECT_FALSE(pencil.Span({0.001, 0.0, 1.0}, {0.3, 0.1, 1.0}));
  EXPECT_FALSE(pencil.Span({0.3, 0.1, 1.0}, {0.0, 0.0, 1.0}));
  EXPECT_TRUE(pencil.Span({0.1, 0.0, 1.0}, {0.3, 0.1, 1.0}));
}

}  // namespace
}  // namespace plumb
