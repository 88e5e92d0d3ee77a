// Several priors for one frame: the right one wins, and nothing is guessed between equals.
#include <chrono>
#include <cstring>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "plumb/runtime/pose_refiner.h"
#include "support/allocation_counter.h"
#include "support/room_refiner.h"

namespace plumb {
namespace {

using testing::Disturb;
using ::testing::HasSubstr;
using testing::HaveSameBits;
using testing::InputOf;
using testing::kDegree;
using testing::QueryPose;
using testing::Render;
using testing::RoomRefiner;

constexpr int kNumQueries = 8;
const Eigen::Vector3d kTwinOffset(500.0, 0.0, 0.0);

/// 10 cm and 2 deg off, as the priors of these tests claim.
PosePrior Near(const Rigid3& pose, Random* random) {
  return {Disturb(pose, 0.10, 2.0 * kDegree, random), 0.10, 2.0 * kDegree};
}
/// A place more than a metre away that looks elsewhere.
PosePrior Elsewhere(const Rigid3& pose, Random* random) {
  return {Disturb(pose, 1.2, 35.0 * kDegree, random), 0.10, 2.0 * kDegree};
}

/// The same camera in the twin room.
Rigid3 InTwin(const Rigid3& pose) {
  return {pose.rotation, pose.translation - pose.rotation * kTwinOffset};
}

/// Two rooms that look the same, far apart.
RoomRefiner TwinRooms() {
  std::vector<Segment3> lines = testing::RoomLines();
  for (const Segment3& line : testing::RoomLines()) {
    lines.push_back({line.start + kTwinOffset, line.end + kTwinOffset});
  }
  std::vector<Rigid3> key_frames = testing::RoomKeyFrames();
  for (const Rigid3& pose : testing::RoomKeyFrames()) key_frames.push_back(InTwin(pose));
  return RoomRefiner(lines, {}, key_frames);
}

TEST(MorePriors, TheRightOneWinsWhereverItStands) {
  RoomRefiner room(testing::RoomLines());
  Random random(31);
  for (int k = 0; k < kNumQueries; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = Render(room.lines, truth, 2000 + k);
    const PosePrior right = Near(truth, &random);
    const std::vector<PosePrior> wrong = {Elsewhere(truth, &random), Elsewhere(truth, &random)};
    for (uint32_t place = 0; place < 3; ++place) {
      std::vector<PosePrior> priors = wrong;
      priors.insert(priors.begin() + place, right);
      RefineInput input = InputOf(segments, priors[0].cam_from_world);
      input.more_priors = std::span(priors).subspan(1);
      const RefineResult result = room.Refine(input);
      EXPECT_EQ(ToString(result.status), "REFINED") << "query " << k << ", place " << place;
      EXPECT_EQ(result.prior_index, place) << "query " << k;
      const PoseDistance error = DistanceBetween(result.cam_from_world, truth);
      EXPECT_LT(error.position_m, 0.01) << "query " << k << ", place " << place;
      EXPECT_LT(error.rotation_rad, 0.2 * kDegree) << "query " << k << ", place " << place;
      EXPECT_GT(result.matches.size(), 15u);
      EXPECT_LT(result.covariance.diagonal().maxCoeff(), 1e-3) << "of the refined pose";
    }
  }
}

TEST(MorePriors, WithoutARightOneTheFirstIsKept) {
  RoomRefiner room(testing::RoomLines());
  Random random(32);
  for (int k = 0; k < kNumQueries; ++k) {
    const auto segments = Render({}, QueryPose(k), 2100 + k, {.num_clutter = 200});
    const Rigid3 first = QueryPose(k);
    const std::vector<PosePrior> more = {Elsewhere(first, &random), Elsewhere(first, &random),
                                         Near(first, &random)};
    RefineInput input = InputOf(segments, first);
    input.more_priors = more;
    const RefineResult result = room.Refine(input);
    EXPECT_NE(ToString(result.status), "REFINED") << "query " << k;
    EXPECT_TRUE(HaveSameBits(result.cam_from_world, first)) << "query " << k;
    EXPECT_NEAR(result.covariance(5, 5), 0.10 * 0.10 / 3, 1e-12);
    EXPECT_EQ(result.prior_index, 0u);
  }
}

TEST(MorePriors, AnExactFirstOneIsKeptBesideAWorseOne) {
  RoomRefiner room(testing::RoomLines());
  Random random(33);
  for (int k = 0; k < 4; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = Render(room.lines, truth, 2200 + k, {.noise_px = 0.0});
    const std::vector<PosePrior> more = {Near(truth, &random), Elsewhere(truth, &random)};
    RefineInput input = InputOf(segments, truth);
    input.more_priors = more;
    const RefineResult result = room.Refine(input);
    EXPECT_EQ(ToString(result.status), "KEPT_PRIOR") << "query " << k;
    EXPECT_TRUE(HaveSameBits(result.cam_from_world, truth)) << "query " << k;
  }
}

TEST(MorePriors, AnExactOneBesideAWrongFirstOneIsTaken) {
  RoomRefiner room(testing::RoomLines());
  Random random(34);
  const Rigid3 truth = QueryPose(2);
  const auto segments = Render(room.lines, truth, 2300, {.noise_px = 0.0});
  const std::vector<PosePrior> more = {{truth, 0.10, 2.0 * kDegree}};
  RefineInput input = InputOf(segments, Elsewhere(truth, &random).cam_from_world);
  input.more_priors = more;
  const RefineResult result = room.Refine(input);
  EXPECT_EQ(ToString(result.status), "REFINED");
  EXPECT_EQ(result.prior_index, 1u);
  EXPECT_LT(DistanceBetween(result.cam_from_world, truth).position_m, 0.001);
}

TEST(MorePriors, TwoEqualPlacesAreAmbiguous) {
  RoomRefiner rooms = TwinRooms();
  Random random(35);
  for (int k = 0; k < kNumQueries; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = Render(testing::RoomLines(), truth, 2400 + k);
    const PosePrior here = Near(truth, &random), there = Near(InTwin(truth), &random);
    RefineInput input = InputOf(segments, here.cam_from_world);
    EXPECT_EQ(ToString(rooms.Refine(input).status), "REFINED") << "one prior, query " << k;
    for (const bool swapped : {false, true}) {
      const PosePrior& first = swapped ? there : here;
      const std::vector<PosePrior> more = {swapped ? here : there};
      input = InputOf(segments, first.cam_from_world);
      input.more_priors = more;
      const RefineResult result = rooms.Refine(input);
      EXPECT_EQ(ToString(result.status), "AMBIGUOUS") << "query " << k;
      EXPECT_TRUE(HaveSameBits(result.cam_from_world, first.cam_from_world)) << "query " << k;
      EXPECT_GT(result.runner_up_ratio, 0.97) << "query " << k;
      EXPECT_EQ(result.prior_index, 0u);
    }
  }
}

TEST(MorePriors, PointsDecideWhereLinesDoNot) {
  RoomRefiner room(testing::RoomLines());
  Random random(36);
  const Rigid3 truth = QueryPose(3);
  const auto points = testing::RenderPoints(truth, 150, 0.25, 2);
  const std::vector<PosePrior> more = {Near(truth, &random)};
  RefineInput input = InputOf({}, Elsewhere(truth, &random).cam_from_world);
  input.points = points;
  EXPECT_EQ(ToString(room.Refine(input).status), "LOW_SUPPORT") << "the first prior alone";
  input.more_priors = more;
  const RefineResult result = room.Refine(input);
  EXPECT_EQ(ToString(result.status), "REFINED");
  EXPECT_EQ(result.prior_index, 1u);
  EXPECT_LT(DistanceBetween(result.cam_from_world, truth).position_m, 0.005);
}

TEST(MorePriors, EqualInputsGiveEqualBits) {
  RoomRefiner room(testing::RoomLines()), other(testing::RoomLines());
  Random random(37);
  const Rigid3 truth = QueryPose(1);
  const auto segments = Render(room.lines, truth, 2500);
  const std::vector<PosePrior> more = {Elsewhere(truth, &random), Near(truth, &random)};
  RefineInput input = InputOf(segments, Elsewhere(truth, &random).cam_from_world);
  input.more_priors = more;
  const RefineResult first = room.Refine(input);
  room.Refine(InputOf(Render(room.lines, QueryPose(3), 2501), QueryPose(3)));
  for (const RefineResult& result : {room.Refine(input), other.Refine(input)}) {
    EXPECT_EQ(result.status, first.status);
    EXPECT_EQ(result.prior_index, first.prior_index);
    EXPECT_TRUE(HaveSameBits(result.cam_from_world, first.cam_from_world));
    EXPECT_EQ(result.covariance, first.covariance);
    EXPECT_EQ(result.evidence_nats, first.evidence_nats);
  }
}

TEST(MorePriors, DoNotAllocateOnceWarm) {
  RoomRefiner room(testing::RoomLines());
  Random random(38);
  const Rigid3 truth = QueryPose(0);
  const auto segments = Render(room.lines, truth, 2600);
  const std::vector<PosePrior> more = {Elsewhere(truth, &random), Near(truth, &random)};
  RefineInput input = InputOf(segments, Elsewhere(truth, &random).cam_from_world);
  input.more_priors = more;
  RefineResult result;
  ASSERT_TRUE(room.refiner->Refine(input, &result));
  const size_t before = testing::num_allocations;
  ASSERT_TRUE(room.refiner->Refine(input, &result));
  EXPECT_EQ(testing::num_allocations - before, 0u);
}

/// Of one frame with kMaxMorePriors wrong priors beside a wrong first one [s].
double SecondsForWrongPriors(int64_t time_budget_ns, RefineResult* result) {
  RoomRefiner room(testing::RoomLines(), {.time_budget_ns = time_budget_ns});
  Random random(39);
  const Rigid3 truth = QueryPose(2);
  const auto segments = Render(room.lines, truth, 2700);
  std::vector<PosePrior> more;
  for (size_t k = 0; k < kMaxMorePriors; ++k) more.push_back(Elsewhere(truth, &random));
  RefineInput input = InputOf(segments, Elsewhere(truth, &random).cam_from_world);
  input.more_priors = more;
  *result = room.Refine(input);  // warms up
  double shortest = 1e9;         // Other programs may hold one up.
  for (int run = 0; run < 3; ++run) {
    const auto start = std::chrono::steady_clock::now();
    *result = room.Refine(input);
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    shortest = std::min(shortest, spent.count());
  }
  EXPECT_NE(ToString(result->status), "REFINED");
  EXPECT_TRUE(HaveSameBits(result->cam_from_world, input.prior.cam_from_world));
  return shortest;
}

TEST(MorePriors, ATimeBudgetHoldsForAllOfThemTogether) {
  RefineResult result;
  const double endless = SecondsForWrongPriors(0, &result);
  EXPECT_FALSE(result.stages.out_of_time);
  const double budget = 0.2 * endless;
  const double spent = SecondsForWrongPriors(static_cast<int64_t>(1e9 * budget), &result);
  EXPECT_TRUE(result.stages.out_of_time);
  // One attempt at its least, and the report, may come on top.
  EXPECT_LT(spent, budget + 0.3 * endless);
}

TEST(MorePriors, BadOnesAreNamedByTheirPlace) {
  RoomRefiner room(testing::RoomLines());
  const auto error_of = [&](const std::vector<PosePrior>& more) {
    RefineInput input = InputOf({}, QueryPose(0));
    input.more_priors = more;
    RefineResult result;
    const Status status = room.refiner->Refine(input, &result);
    if (status) return std::string();
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
    return status.error().message;
  };
  const PosePrior good{QueryPose(1), 0.1, 0.03};
  EXPECT_EQ(error_of(std::vector<PosePrior>(kMaxMorePriors, good)), "");
  EXPECT_THAT(error_of(std::vector<PosePrior>(kMaxMorePriors + 1, good)),
              HasSubstr("more_priors has 9 entries, more than 8"));
  PosePrior bad = good;
  bad.cam_from_world.translation.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(error_of({good, bad}), HasSubstr("more_priors[1]: translation"));
  bad = good;
  bad.cam_from_world.rotation.coeffs() *= 2.0;
  EXPECT_THAT(error_of({bad, good}), HasSubstr("more_priors[0]: rotation"));
  bad = good;
  bad.position_sigma_m = -0.5;
  EXPECT_THAT(error_of({good, good, bad}), HasSubstr("more_priors[2].position_sigma_m -0.5"));
  bad = good;
  bad.gravity = GravityPrior{.sigma_rad = 2.0};
  EXPECT_THAT(error_of({bad}), HasSubstr("more_priors[0]: gravity uncertainty 2 rad"));
}

TEST(MorePriors, ThePapersMethodRefusesThem) {
  RoomRefiner room(testing::RoomLines(), {.method = RefineMethod::kPaper});
  const std::vector<PosePrior> more = {{QueryPose(1), 0.1, 0.03}};
  RefineInput input = InputOf({}, QueryPose(0));
  input.more_priors = more;
  RefineResult result;
  const Status status = room.refiner->Refine(input, &result);
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().message, HasSubstr("more_priors has 1 entries"));
}

}  // namespace
}  // namespace plumb
