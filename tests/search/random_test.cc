#include "plumb/search/random.h"

#include <set>

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(Random, EqualSeedsGiveEqualDraws) {
  Random a(42), b(42), c(43);
  bool differs = false;
  for (int i = 0; i < 100; ++i) {
    const uint64_t value = a.Next();
    EXPECT_EQ(value, b.Next());
    differs |= value != c.Next();
  }
  EXPECT_TRUE(differs);
}

TEST(Random, FirstDrawIsThatOfSplitMix64) {
  // Reference value of the published generator for the seed 0.
  EXPECT_EQ(Random(0).Next(), 0xe220a8397b1dcdafu);
}

TEST(Random, UniformIsInTheUnitIntervalWithItsMeanAndVariance) {
  Random random(1);
  double sum = 0.0, squares = 0.0;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) {
    const double u = random.Uniform();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    sum += u;
    squares += u * u;
  }
  EXPECT_NEAR(sum / kCount, 0.5, 0.01);
  EXPECT_NEAR(squares / kCount, 1.0 / 3.0, 0.01);
}

TEST(Random, BelowReachesEveryValueAndNoOther) {
  Random random(2);
  std::set<uint32_t> seen;
  for (int i = 0; i < 500; ++i) seen.insert(random.Below(7));
  EXPECT_EQ(seen, (std::set<uint32_t>{0, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(random.Below(1), 0u);
}

TEST(Random, NormalsAreStandardAndIndependent) {
  Random random(3);
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  int beyond_two = 0;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) {
    const Eigen::Vector3d v = random.Normal3(2.0f).cast<double>();
    ASSERT_TRUE(v.allFinite());
    mean += v / kCount;
    second += v * v.transpose() / kCount;
    beyond_two += static_cast<int>((v.array().abs() > 4.0).count());
  }
  EXPECT_LT(mean.norm(), 0.06);
  EXPECT_LT((second - 4.0 * Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 0.12);
  EXPECT_NEAR(beyond_two / (3.0 * kCount), 0.0455, 0.005);  // outside two deviations
}

TEST(Random, MixedSeedsOfNeighboursAreUnrelated) {
  std::set<uint64_t> seeds;
  for (uint64_t a = 0; a < 20; ++a) {
    for (uint64_t b = 0; b < 20; ++b) seeds.insert(MixSeeds(a, b));
  }
  EXPECT_EQ(seeds.size(), 400u);
  EXPECT_NE(MixSeeds(1, 2), MixSeeds(2, 1));
}

}  // namespace
}  // namespace plumb
