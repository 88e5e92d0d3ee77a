#include "plumb/matching/match_evidence.h"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "support/line_scene.h"

namespace plumb {
namespace {

using testing::AsProjectedLines;

MatchEvidence Measure(const std::vector<Segment2>& lines, const std::vector<float>& weights,
                      const std::vector<Segment2>& segments) {
  SegmentTable table;
  table.Assign(segments);
  return EvidenceMeter().Measure(AsProjectedLines(lines, weights), table);
}

MatchEvidence Measure(const std::vector<Segment2>& lines, const std::vector<Segment2>& segments) {
  return Measure(lines, std::vector<float>(lines.size(), 1.0f), segments);
}

/// Segments of 60 px anywhere in 640 x 480.
std::vector<Segment2> Scatter(size_t count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> x(100, 540), y(100, 380), turn(0, std::numbers::pi);
  std::vector<Segment2> segments;
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d middle(x(rng), y(rng));
    const double a = turn(rng);
    const Eigen::Vector2d half(30 * std::cos(a), 30 * std::sin(a));
    segments.push_back({middle - half, middle + half});
  }
  return segments;
}

TEST(MatchEvidence, NothingSaysNothing) {
  const std::vector<Segment2> some = Scatter(10, 1);
  EXPECT_EQ(Measure({}, some).nats, 0.0);
  EXPECT_EQ(Measure(some, {}).nats, 0.0);
  EXPECT_EQ(Measure(some, {}).num_lines, 10u);
  EXPECT_EQ(Measure(some, {}).found_share, 0.0);
}

TEST(MatchEvidence, OneLineFoundAloneHasTheLogarithmOfItsChance) {
  const std::vector<Segment2> line = {{{100, 100}, {200, 100}}};
  const MatchEvidence evidence = Measure(line, line);
  // Its own segment is the only neighbour; all lines are found, so that r = 1.
  EXPECT_NEAR(evidence.nats, -std::log(-std::expm1(-1.2 * 2.0 / 40.0)), 1e-3);
  EXPECT_NEAR(evidence.found_share, 1.0, 1e-5);
  EXPECT_EQ(evidence.num_found, 1u);
}

TEST(MatchEvidence, AFewLinesThatAreAllFoundAreEnough) {
  // Five lines of a bare corridor beat the chance of a search with thousands of poses.
  const std::vector<Segment2> lines = Scatter(5, 2);
  EXPECT_GT(Measure(lines, lines).nats, std::log(4000.0));
}

TEST(MatchEvidence, ManyLinesFoundByChanceAreNotEnough) {
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
    const MatchEvidence evidence = Measure(Scatter(300, seed), Scatter(1000, seed + 100));
    EXPECT_GT(evidence.num_found, 9u);  // a rule that counts would be content
    EXPECT_LT(evidence.nats, 3.0);
  }
}

TEST(MatchEvidence, ParallelClutterMakesALineSayLess) {
  const std::vector<Segment2> line = {{{100, 100}, {200, 100}}};
  std::vector<Segment2> blinds = line;
  double last = Measure(line, blinds).nats;
  for (int i = 1; i <= 8; ++i) {
    blinds.push_back({{100, 100.0 + 4 * i}, {200, 100.0 + 4 * i}});
    const double nats = Measure(line, blinds).nats;
    EXPECT_LT(nats, last);
    last = nats;
  }
  // Another direction does not matter.
  blinds.push_back({{150, 90}, {150, 120}});
  EXPECT_EQ(Measure(line, blinds).nats, last);
}

TEST(MatchEvidence, MissingLinesCostLittleWhenTheFoundOnesAreMany) {
  std::vector<Segment2> lines = Scatter(40, 3);
  const std::vector<Segment2> segments(lines.begin(), lines.begin() + 20);
  const double half = Measure(lines, segments).nats;
  lines.resize(20);
  const double all = Measure(lines, segments).nats;
  EXPECT_GT(half, 20.0);
  EXPECT_LT(half, all);
}

TEST(MatchEvidence, OneSegmentStandsForOneLine) {
  const std::vector<Segment2> line = {{{100, 100}, {200, 100}}};
  const MatchEvidence once = Measure(line, line);
  const MatchEvidence thrice = Measure({line[0], line[0], line[0]}, line);
  EXPECT_EQ(thrice.nats, once.nats);
  EXPECT_EQ(thrice.num_lines, 1u);
}

TEST(MatchEvidence, GatesOfDistanceAngleAndOverlap) {
  const std::vector<Segment2> line = {{{100, 100}, {200, 100}}};
  const auto finds = [&](const Segment2& segment) {
    return Measure(line, {segment}).num_found == 1u;
  };
  EXPECT_TRUE(finds({{100, 101.9}, {200, 101.9}}));
  EXPECT_FALSE(finds({{100, 102.1}, {200, 102.1}}));
  EXPECT_TRUE(finds({{130, 99}, {160, 100.5}}));
  EXPECT_FALSE(finds({{130, 99}, {160, 101}}));     // |sin| 0.067
  EXPECT_FALSE(finds({{192.5, 100}, {207, 100}}));  // 7.5 px
  EXPECT_FALSE(finds({{170, 100}, {240, 100}}));    // 30 of 70 px
  EXPECT_TRUE(finds({{160, 100}, {230, 100}}));
}

TEST(MatchEvidence, WeightsScaleIt) {
  const std::vector<Segment2> lines = Scatter(6, 4);
  const double whole = Measure(lines, lines).nats;
  EXPECT_NEAR(Measure(lines, std::vector<float>(6, 0.5f), lines).nats, 0.5 * whole, 1e-6);
}

}  // namespace
}  // namespace plumb
