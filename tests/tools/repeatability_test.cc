// Repeatability on a wall that two cameras face.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tools/metrics/repeatability.h"

namespace plumb::tools {
namespace {

constexpr double kFocalPx = 300.0, kDepthM = 2.0;
// The second camera stands 0.1 m to the right, so the wall's image moves 15 px to the left.
constexpr double kShiftPx = -15.0;

Segment2 Line(double x1, double y1, double x2, double y2) { return {{x1, y1}, {x2, y2}, 1.0}; }

/// Two views of a wall, 2 m away, with what each has found there.
struct WallViews {
  Camera camera{kFocalPx, kFocalPx, 159.5, 119.5, 320, 240};
  std::vector<float> first_depth, second_depth;
  std::vector<Segment2> first, second;

  WallViews() : first_depth(320 * 240, static_cast<float>(kDepthM)), second_depth(first_depth) {}

  DepthView ViewOf(const std::vector<float>& depth) const {
    return {DepthFormat::kFloat, depth.data(), int64_t{320} * 4, 320, 240, 1.0};
  }

  RepeatabilityTally Evaluate() const {
    Rigid3 second_from_world;
    second_from_world.translation.x() = kShiftPx / kFocalPx * kDepthM;
    RepeatabilityTally tally;
    AddPair(*Rectifier::Create(camera), {Rigid3(), ViewOf(first_depth), first},
            {second_from_world, ViewOf(second_depth), second}, &tally);
    return tally;
  }
};

/// Where the second view shows `segment`, moved down by `down_start` and `down_end` px.
Segment2 Moved(const Segment2& segment, double down_start, double down_end) {
  return {segment.start + Eigen::Vector2d(kShiftPx, down_start),
          segment.end + Eigen::Vector2d(kShiftPx, down_end), 1.0};
}

TEST(Repeatability, SameSegmentIsFoundWithoutError) {
  WallViews views;
  views.first = {Line(60, 50, 160, 50), Line(200, 60, 230, 160)};
  for (const Segment2& segment : views.first) views.second.push_back(Moved(segment, 0, 0));
  std::swap(views.second[0].start, views.second[0].end);  // the order of the ends says nothing
  const RepeatabilityTally tally = views.Evaluate();
  EXPECT_EQ(tally.num_pairs, 1u);
  EXPECT_EQ(tally.num_expected, 2u);
  EXPECT_EQ(tally.num_found, 2u);
  ASSERT_EQ(tally.errors_px.size(), 2u);
  for (const double error : tally.errors_px) EXPECT_NEAR(error, 0.0, 1e-4);
}

TEST(Repeatability, ErrorIsTheMeanOfTheEndsDistances) {
  WallViews views;
  views.first = {Line(60, 50, 160, 50)};
  views.second = {Moved(views.first[0], 0.5, 1.5)};
  RepeatabilityTally tally = views.Evaluate();
  EXPECT_EQ(tally.num_found, 1u);
  ASSERT_EQ(tally.errors_px.size(), 1u);
  EXPECT_NEAR(tally.errors_px[0], 1.0, 1e-3);
  views.second = {Moved(views.first[0], -1, 1)};  // crossing it is no excuse
  EXPECT_NEAR(views.Evaluate().errors_px.at(0), 1.0, 1e-3);
}

TEST(Repeatability, BeyondTwoPixelsItIsLostBeyondFiveItHasNoError) {
  WallViews views;
  views.first = {Line(60, 50, 160, 50)};
  for (const auto& [down, found, has_error] :
       {std::tuple(1.9, true, true), {2.1, false, true}, {4.9, false, true}, {5.1, false, false}}) {
    views.second = {Moved(views.first[0], 0, down)};
    const RepeatabilityTally tally = views.Evaluate();
    EXPECT_EQ(tally.num_found == 1, found) << down;
    EXPECT_EQ(tally.errors_px.size() == 1, has_error) << down;
  }
}

TEST(Repeatability, TheNearestGivesTheErrorAndAnyOneFinds) {
  WallViews views;
  views.first = {Line(60, 50, 160, 50)};
  views.second = {Moved(views.first[0], 3, 3), Moved(views.first[0], 0.5, 0.5),
                  Moved(views.first[0], -1, -1)};
  const RepeatabilityTally tally = views.Evaluate();
  EXPECT_EQ(tally.num_found, 1u);
  EXPECT_NEAR(tally.errors_px.at(0), 0.5, 1e-3);
}

TEST(Repeatability, MoreThanHalfMustBeShared) {
  WallViews views;
  views.first = {Line(60, 50, 160, 50)};
  views.second = {Line(60 + kShiftPx, 50, 108 + kShiftPx, 50)};
  EXPECT_EQ(views.Evaluate().num_found, 0u);
  views.second = {Line(60 + kShiftPx, 50, 114 + kShiftPx, 50)};
  EXPECT_EQ(views.Evaluate().num_found, 1u);
  views.second = {Line(0, 50, 319, 50)};  // a longer one covers it
  EXPECT_EQ(views.Evaluate().num_found, 1u);
}

TEST(Repeatability, CrossingSegmentsAreOthers) {
  WallViews views;
  views.first = {Line(60, 50, 84, 50)};
  views.second = {Moved(views.first[0], -1.2, 1.2)};  // sine 0.1, yet within 2 px
  EXPECT_EQ(views.Evaluate().num_found, 0u);
  EXPECT_TRUE(views.Evaluate().errors_px.empty());
}

TEST(Repeatability, ShortAndInvisibleSegmentsAreNotExpected) {
  WallViews views;
  views.first = {Line(60, 50, 78, 50),      // 18 px
                 Line(1, 100, 14, 200),     // leaves the second image
                 Line(60, 150, 160, 150)};  // behind a box there
  for (int y = 130; y < 170; ++y) {
    for (int x = 40; x < 120; ++x) views.second_depth[y * 320 + x] = 1.0f;
  }
  EXPECT_EQ(views.Evaluate().num_expected, 0u);
}

TEST(Repeatability, DepthThatIsMissingOrFartherHidesNothing) {
  WallViews views;
  views.first = {Line(60, 150, 160, 150)};
  views.second_depth.assign(320 * 240, 0.0f);
  EXPECT_EQ(views.Evaluate().num_expected, 1u);
  views.second_depth.assign(320 * 240, 5.0f);
  EXPECT_EQ(views.Evaluate().num_expected, 1u);
}

TEST(Repeatability, WithoutDepthNothingIsExpected) {
  WallViews views;
  views.first = {Line(60, 150, 160, 150)};
  views.first_depth.assign(320 * 240, 0.0f);
  const RepeatabilityTally tally = views.Evaluate();
  EXPECT_EQ(tally.num_expected, 0u);
  EXPECT_DOUBLE_EQ(tally.FoundShare(), 0.0);
}

TEST(Repeatability, PairsAddUp) {
  WallViews views;
  views.first = {Line(60, 50, 160, 50)};
  RepeatabilityTally tally;
  const RepeatabilityView view{Rigid3(), views.ViewOf(views.first_depth), views.first};
  const RepeatabilityView blind{Rigid3(), views.ViewOf(views.first_depth), {}};
  AddPair(*Rectifier::Create(views.camera), view, view, &tally);
  AddPair(*Rectifier::Create(views.camera), view, blind, &tally);
  EXPECT_EQ(tally.num_pairs, 2u);
  EXPECT_DOUBLE_EQ(tally.FoundShare(), 0.5);
  EXPECT_EQ(tally.errors_px.size(), 1u);
}

}  // namespace
}  // namespace plumb::tools
