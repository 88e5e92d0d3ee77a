#include "plumb/points/descriptor_matcher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace plumb {

bool operator==(const DescriptorPair& x, const DescriptorPair& y) {
  return x.a == y.a && x.b == y.b;
}

namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<PointDescriptor> RandomDescriptors(size_t count, unsigned seed) {
  std::mt19937 rng(seed);
  std::vector<PointDescriptor> descriptors(count);
  for (auto& descriptor : descriptors) {
    for (uint8_t& value : descriptor) value = static_cast<uint8_t>(rng() % 256);
  }
  return descriptors;
}

/// The same with noise, in another order.
std::vector<PointDescriptor> Disturbed(std::vector<PointDescriptor> descriptors, int noise,
                                       unsigned seed) {
  std::mt19937 rng(seed);
  for (auto& descriptor : descriptors) {
    for (uint8_t& value : descriptor) {
      const int moved = value + static_cast<int>(rng() % (2 * noise + 1)) - noise;
      value = static_cast<uint8_t>(std::clamp(moved, 0, 255));
    }
  }
  std::shuffle(descriptors.begin(), descriptors.end(), rng);
  return descriptors;
}

DescriptorTable TableOf(const std::vector<PointDescriptor>& descriptors) {
  DescriptorTable table;
  for (const PointDescriptor& descriptor : descriptors) table.Add(descriptor);
  return table;
}

std::vector<DescriptorPair> Match(const std::vector<PointDescriptor>& a,
                                  const std::vector<PointDescriptor>& b, double max_ratio) {
  std::vector<DescriptorPair> pairs;
  DescriptorMatcher().Match(TableOf(a), TableOf(b), max_ratio, &pairs);
  return pairs;
}

PointDescriptor Filled(uint8_t value) {
  PointDescriptor descriptor;
  descriptor.fill(value);
  return descriptor;
}

double Distance(const PointDescriptor& x, const PointDescriptor& y) {
  double square = 0.0;
  for (size_t i = 0; i < x.size(); ++i) square += (x[i] - y[i]) * (x[i] - y[i]);
  return std::sqrt(square);
}

/// One loop for each direction, as the definition says.
std::vector<DescriptorPair> MatchPlainly(const std::vector<PointDescriptor>& a,
                                         const std::vector<PointDescriptor>& b, double max_ratio) {
  const auto nearest = [](const PointDescriptor& x, const std::vector<PointDescriptor>& all) {
    std::vector<std::pair<double, uint32_t>> ranked;
    for (uint32_t i = 0; i < all.size(); ++i) ranked.emplace_back(Distance(x, all[i]), i);
    std::sort(ranked.begin(), ranked.end());
    return ranked;
  };
  std::vector<DescriptorPair> pairs;
  for (uint32_t i = 0; i < a.size(); ++i) {
    const auto ranked = nearest(a[i], b);
    if (ranked[0].first < max_ratio * ranked[1].first &&
        nearest(b[ranked[0].second], a)[0].second == i) {
      pairs.push_back({i, ranked[0].second});
    }
  }
  return pairs;
}

TEST(DescriptorMatcher, AgreesWithThePlainDefinition) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    const auto a = RandomDescriptors(150, seed);
    auto b = Disturbed(a, 60, seed + 10);
    const auto strangers = RandomDescriptors(50, seed + 20);
    b.insert(b.begin() + 70, strangers.begin(), strangers.end());
    for (const double ratio : {0.3, 0.8, 0.95, 1.0}) {
      EXPECT_EQ(Match(a, b, ratio), MatchPlainly(a, b, ratio)) << "ratio " << ratio;
    }
  }
}

TEST(DescriptorMatcher, RecognisesDisturbedDescriptors) {
  const auto a = RandomDescriptors(200, /*seed=*/4);
  const auto b = Disturbed(a, 20, /*seed=*/5);
  const auto pairs = Match(a, b, 0.8);
  EXPECT_EQ(pairs.size(), a.size());
  for (const DescriptorPair& pair : pairs) EXPECT_LT(Distance(a[pair.a], b[pair.b]), 250.0);
}

TEST(DescriptorMatcher, KeepsStrangersApart) {
  EXPECT_THAT(Match(RandomDescriptors(200, 6), RandomDescriptors(200, 7), 0.8), IsEmpty());
}

TEST(DescriptorMatcher, LeavesOutWhatHasTwoLookAlikes) {
  const auto a = RandomDescriptors(1, /*seed=*/8);
  EXPECT_THAT(Match(a, {a[0], a[0]}, 0.8), IsEmpty());
  EXPECT_THAT(Match(a, {a[0], Filled(0)}, 0.8), ElementsAre(DescriptorPair{0, 0}));
}

TEST(DescriptorMatcher, IsOneToOne) {
  // Both rows of `a` look like row 0 of `b`; only the nearer one gets it.
  PointDescriptor near = Filled(100), nearer = Filled(100);
  near[0] = 110;
  nearer[0] = 105;
  EXPECT_THAT(Match({near, nearer}, {Filled(100), Filled(200)}, 0.8),
              ElementsAre(DescriptorPair{1, 0}));
}

TEST(DescriptorMatcher, GivesTiesToTheSmallerIndex) {
  EXPECT_THAT(Match({Filled(9), Filled(9)}, {Filled(10), Filled(200)}, 0.8),
              ElementsAre(DescriptorPair{0, 0}));
}

TEST(DescriptorMatcher, HoldsTheLargestDistance) {
  EXPECT_THAT(Match({Filled(255)}, {Filled(0), Filled(254)}, 0.8),
              ElementsAre(DescriptorPair{0, 1}));
}

TEST(DescriptorMatcher, NeedsASecondNearest) {
  EXPECT_THAT(Match({Filled(1)}, {Filled(1)}, 0.8), IsEmpty());
  EXPECT_THAT(Match({Filled(1)}, {}, 0.8), IsEmpty());
  EXPECT_THAT(Match({}, {Filled(1), Filled(2)}, 0.8), IsEmpty());
}

}  // namespace
}  // namespace plumb
