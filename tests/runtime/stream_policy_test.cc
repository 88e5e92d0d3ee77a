// The stream's state machine: prediction, growth of the uncertainty, lost detector.
#include "plumb/runtime/stream_policy.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

namespace plumb {
namespace {

Rigid3 Pose(double angle_rad, const Eigen::Vector3d& translation) {
  return {ExpSo3(angle_rad * Eigen::Vector3d(0.3, -0.5, 0.8).normalized()), translation};
}

RefineResult ResultOf(RefineStatus status, const Rigid3& pose, double support) {
  RefineResult result;
  result.status = status;
  result.cam_from_world = pose;
  result.map_support = support;
  return result;
}

void ExpectSamePose(const Rigid3& a, const Rigid3& b) {
  const PoseDistance distance = DistanceBetween(a, b);
  EXPECT_LT(distance.position_m, 1e-12);
  EXPECT_LT(distance.rotation_rad, 1e-7);
}

TEST(StreamPolicy, FirstFrameHasNoPredictionAndIsSearchedFromItsOwnPrior) {
  const StreamState state;
  const PosePrior tracker{Pose(0.2, {1, 2, 3}), 0.2, 0.05};
  EXPECT_FALSE(PredictLocally(state, {}, tracker).has_value());
  const PosePrior search = SearchPrior(state, tracker);
  ExpectSamePose(search.cam_from_world, tracker.cam_from_world);
  EXPECT_EQ(search.position_sigma_m, 0.2);
}

TEST(StreamPolicy, PredictionCarriesTheCorrectionAlong) {
  // A tracker that is off by a constant transform of the world is corrected exactly.
  const Rigid3 world_error = Pose(0.1, {0.3, -0.2, 0.1});
  const Rigid3 truth0 = Pose(0.4, {0.1, 0.2, 1.0}), truth1 = Pose(0.7, {0.3, -0.1, 1.2});
  StreamState state;
  Advance({}, truth0 * world_error, truth0, ResultOf(RefineStatus::kRefined, truth0, 0.5), &state);
  const auto prior = PredictLocally(state, {}, {truth1 * world_error});
  ASSERT_TRUE(prior.has_value());
  ExpectSamePose(prior->cam_from_world, truth1);
}

TEST(StreamPolicy, UncertaintyIsTwoCentimetresAndHalfADegreeAfterASuccess) {
  StreamState state;
  Advance({}, {}, {}, ResultOf(RefineStatus::kRefined, {}, 0.5), &state);
  const auto prior = PredictLocally(state, {}, {});
  ASSERT_TRUE(prior.has_value());
  EXPECT_DOUBLE_EQ(prior->position_sigma_m, 0.02);
  EXPECT_NEAR(prior->rotation_sigma_rad, 0.5 * std::numbers::pi / 180.0, 1e-5);
}

TEST(StreamPolicy, UncertaintyGrowsWithTheRootOfTheFramesSinceTheLastSuccess) {
  StreamState state;
  for (int i = 0; i < 3; ++i) {
    Advance({}, {}, {}, ResultOf(RefineStatus::kLowSupport, {}, 0.0), &state);
  }
  EXPECT_EQ(state.frames_without_success, 3u);
  EXPECT_DOUBLE_EQ(PredictLocally(state, {}, {})->position_sigma_m, 0.02 * 2.0);
  Advance({}, {}, {}, ResultOf(RefineStatus::kRefined, {}, 0.4), &state);
  EXPECT_DOUBLE_EQ(PredictLocally(state, {}, {})->position_sigma_m, 0.02);
}

TEST(StreamPolicy, UncertaintyGrowsNoFartherThanTheTrackersOwn) {
  StreamState state;
  Advance({}, {}, {}, ResultOf(RefineStatus::kRefined, {}, 0.5), &state);
  state.frames_without_success = 1'000'000;
  const auto prior = PredictLocally(state, {}, {{}, 0.3, 0.1});
  EXPECT_EQ(prior->position_sigma_m, 0.3);
  EXPECT_EQ(prior->rotation_sigma_rad, 0.1);
  // A tracker that knows better than the stream's options does not make them smaller.
  EXPECT_EQ(PredictLocally(state, {}, {{}, 0.001, 0.0001})->position_sigma_m, 0.02);
}

TEST(StreamPolicy, KeptPriorIsASuccessAndOthersAreNot) {
  EXPECT_TRUE(IsSuccess(RefineStatus::kRefined));
  EXPECT_TRUE(IsSuccess(RefineStatus::kKeptPrior));
  EXPECT_FALSE(IsSuccess(RefineStatus::kAmbiguous));
  EXPECT_FALSE(IsSuccess(RefineStatus::kDegenerate));
  EXPECT_FALSE(IsSuccess(RefineStatus::kLowSupport));
}

TEST(StreamPolicy, MeanSupportStartsAtTheFirstRefinedFrameAndForgetsSlowly) {
  StreamState state;
  Advance({}, {}, {}, ResultOf(RefineStatus::kRefined, {}, 0.5), &state);
  EXPECT_DOUBLE_EQ(state.mean_support, 0.5);
  Advance({}, {}, {}, ResultOf(RefineStatus::kRefined, {}, 0.3), &state);
  EXPECT_DOUBLE_EQ(state.mean_support, 0.9 * 0.5 + 0.1 * 0.3);
}

TEST(StreamPolicy, OnlyRefinedFramesEnterTheMeanSupport) {
  StreamState state;
  Advance({}, {}, {}, ResultOf(RefineStatus::kRefined, {}, 0.5), &state);
  Advance({}, {}, {}, ResultOf(RefineStatus::kKeptPrior, {}, 0.1), &state);
  Advance({}, {}, {}, ResultOf(RefineStatus::kLowSupport, {}, 0.0), &state);
  EXPECT_DOUBLE_EQ(state.mean_support, 0.5);
}

TEST(StreamPolicy, FrameThatExplainsMuchLessThanUsualIsLostThoughRefined) {
  StreamState state;
  state.mean_support = 0.5;
  EXPECT_FALSE(IsLost(state, {}, ResultOf(RefineStatus::kRefined, {}, 0.36)));
  EXPECT_TRUE(IsLost(state, {}, ResultOf(RefineStatus::kRefined, {}, 0.34)));
  EXPECT_TRUE(IsLost(state, {}, ResultOf(RefineStatus::kKeptPrior, {}, 0.34)));
}

TEST(StreamPolicy, FrameWithoutSuccessIsLostWhateverItsSupport) {
  EXPECT_TRUE(IsLost({}, {}, ResultOf(RefineStatus::kAmbiguous, {}, 0.9)));
  EXPECT_TRUE(IsLost({}, {}, ResultOf(RefineStatus::kDegenerate, {}, 0.9)));
}

TEST(StreamPolicy, NothingIsTooLittleBeforeThereIsAMean) {
  EXPECT_FALSE(IsLost({}, {}, ResultOf(RefineStatus::kRefined, {}, 0.01)));
}

TEST(StreamPolicy, SearchStartsAtThePredictionWithTheTrackersUncertainty) {
  const Rigid3 refined = Pose(0.2, {0, 0, 1}), tracker0 = Pose(0.1, {0, 0.1, 1});
  StreamState state;
  Advance({}, tracker0, refined, ResultOf(RefineStatus::kRefined, refined, 0.5), &state);
  const PosePrior tracker{tracker0, 0.10, 0.035};
  const PosePrior search = SearchPrior(state, tracker);
  ExpectSamePose(search.cam_from_world, refined);
  EXPECT_EQ(search.position_sigma_m, 0.10);
  EXPECT_EQ(search.rotation_sigma_rad, 0.035);
}

TEST(StreamPolicy, SuccessIsBetterThanSupport) {
  const auto result = [](RefineStatus status, double support) {
    return ResultOf(status, {}, support);
  };
  EXPECT_TRUE(IsBetter(result(RefineStatus::kRefined, 0.2), result(RefineStatus::kAmbiguous, 0.4)));
  EXPECT_FALSE(
      IsBetter(result(RefineStatus::kLowSupport, 0.4), result(RefineStatus::kKeptPrior, 0.2)));
  EXPECT_TRUE(IsBetter(result(RefineStatus::kRefined, 0.5), result(RefineStatus::kRefined, 0.4)));
  EXPECT_FALSE(IsBetter(result(RefineStatus::kRefined, 0.4), result(RefineStatus::kRefined, 0.4)));
}

TEST(StreamPolicy, FailureKeepsTheCorrection) {
  const Rigid3 refined = Pose(0.2, {0, 0, 1}), tracker0 = Pose(0.1, {0, 0.1, 1});
  StreamState state;
  Advance({}, tracker0, refined, ResultOf(RefineStatus::kRefined, refined, 0.5), &state);
  const Rigid3 predicted = PredictLocally(state, {}, {tracker0})->cam_from_world;
  Advance({}, tracker0, predicted, ResultOf(RefineStatus::kLowSupport, tracker0, 0.0), &state);
  ExpectSamePose(PredictLocally(state, {}, {tracker0})->cam_from_world, refined);
}

TEST(StreamOptions, ValidateNamesTheMemberOutOfRange) {
  EXPECT_TRUE(StreamOptions{}.Validate().has_value());
  StreamOptions options;
  options.position_sigma_m = 0.0;
  ASSERT_FALSE(options.Validate());
  EXPECT_NE(options.Validate().error().message.find("position_sigma_m"), std::string::npos);
  options = {};
  options.rotation_sigma_rad = std::numeric_limits<double>::quiet_NaN();
  ASSERT_FALSE(options.Validate());
  EXPECT_NE(options.Validate().error().message.find("rotation_sigma_rad"), std::string::npos);
  options = {};
  options.rotation_sigma_rad = 3.3;
  EXPECT_FALSE(options.Validate());
  options = {};
  options.position_sigma_m = 1e-12;
  EXPECT_FALSE(options.Validate());
  options = {};
  options.lost_support_share = 1.0;
  EXPECT_FALSE(options.Validate());
  options = {};
  options.support_memory = -0.1;
  EXPECT_FALSE(options.Validate());
}

}  // namespace
}  // namespace plumb
