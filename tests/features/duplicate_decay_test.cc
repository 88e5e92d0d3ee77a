#include "plumb/features/duplicate_decay.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatEq;

DecodedLine Line(float x1, float y1, float x2, float y2, float score) {
  DecodedLine line{};
  line.start_x = x1;
  line.start_y = y1;
  line.end_x = x2;
  line.end_y = y2;
  line.score = score;
  return line;
}

std::vector<float> Scores(const std::vector<DecodedLine>& lines) {
  std::vector<float> scores;
  for (const DecodedLine& line : lines) scores.push_back(line.score);
  return scores;
}

TEST(DuplicateDecay, LinesFarApartKeepTheirScores) {
  std::vector<DecodedLine> lines = {Line(0, 0, 40, 0, 0.9f), Line(0, 8, 40, 8, 0.8f)};
  DecayDuplicates({.distance_cells2 = 2.0f, .decay = 0.5f}, 0.25f, 0.25f, 0.0f, &lines);
  EXPECT_THAT(Scores(lines), ElementsAre(0.9f, 0.8f));
}

TEST(DuplicateDecay, ADuplicateRanksBelowADistinctLine) {
  std::vector<DecodedLine> lines = {Line(0, 0, 40, 0, 0.9f), Line(0, 2, 40, 2, 0.8f),
                                    Line(0, 80, 40, 80, 0.5f)};
  DecayDuplicates({.distance_cells2 = 2.0f, .decay = 0.5f}, 0.25f, 0.25f, 0.0f, &lines);
  EXPECT_THAT(Scores(lines), ElementsAre(0.9f, 0.5f, FloatEq(0.4f)));
  EXPECT_EQ(lines[2].start_y, 2);
}

TEST(DuplicateDecay, TheOrderOfTheEndPointsDoesNotMatter) {
  std::vector<DecodedLine> lines = {Line(0, 0, 40, 0, 0.9f), Line(40, 2, 0, 2, 0.8f)};
  DecayDuplicates({.distance_cells2 = 2.0f, .decay = 0.5f}, 0.25f, 0.25f, 0.0f, &lines);
  EXPECT_THAT(Scores(lines), ElementsAre(0.9f, FloatEq(0.4f)));
}

TEST(DuplicateDecay, EveryBetterLineCounts) {
  std::vector<DecodedLine> lines = {Line(0, 0, 40, 0, 0.9f), Line(0, 1, 40, 1, 0.8f),
                                    Line(0, 2, 40, 2, 0.8f)};
  DecayDuplicates({.distance_cells2 = 2.0f, .decay = 0.5f}, 0.25f, 0.25f, 0.0f, &lines);
  EXPECT_THAT(Scores(lines), ElementsAre(0.9f, FloatEq(0.4f), FloatEq(0.2f)));
}

TEST(DuplicateDecay, DistancesAreThoseOfTheNetworksCells) {
  // Two pixels apart in y: near in a tall image, far where a cell is two pixels high.
  const std::vector<DecodedLine> lines = {Line(0, 0, 40, 0, 0.9f), Line(0, 2, 40, 2, 0.8f)};
  std::vector<DecodedLine> near = lines, far = lines;
  DecayDuplicates({.distance_cells2 = 1.0f, .decay = 0.5f}, 0.25f, 0.25f, 0.0f, &near);
  DecayDuplicates({.distance_cells2 = 1.0f, .decay = 0.5f}, 0.25f, 0.5f, 0.0f, &far);
  EXPECT_FLOAT_EQ(near[1].score, 0.4f);
  EXPECT_FLOAT_EQ(far[1].score, 0.8f);
}

TEST(DuplicateDecay, WhatFallsBelowTheThresholdGoes) {
  std::vector<DecodedLine> lines = {Line(0, 0, 40, 0, 0.9f), Line(0, 1, 40, 1, 0.15f),
                                    Line(0, 80, 40, 80, 0.12f)};
  DecayDuplicates({.distance_cells2 = 2.0f, .decay = 0.5f}, 0.25f, 0.25f, 0.1f, &lines);
  EXPECT_THAT(Scores(lines), ElementsAre(0.9f, 0.12f));
}

TEST(DuplicateDecay, OneIsOff) {
  std::vector<DecodedLine> lines = {Line(0, 0, 40, 0, 0.9f), Line(0, 0, 40, 0, 0.9f)};
  DecayDuplicates({.distance_cells2 = 2.0f, .decay = 1.0f}, 0.25f, 0.25f, 0.0f, &lines);
  EXPECT_THAT(Scores(lines), ElementsAre(0.9f, 0.9f));
}

}  // namespace
}  // namespace plumb
