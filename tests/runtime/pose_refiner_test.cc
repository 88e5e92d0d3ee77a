#include "plumb/runtime/pose_refiner.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "support/allocation_counter.h"
#include "support/room_refiner.h"
#include "support/synthetic_room.h"

namespace plumb {
namespace {

using testing::Disturb;
using ::testing::HasSubstr;
using testing::HaveSameBits;
using testing::InputOf;
using testing::kDegree;
using testing::LookAlong;
using testing::QueryPose;
using testing::Render;
using testing::RenderPoints;
using Scene = testing::RoomRefiner;

TEST(PoseRefiner, ConvergesFromTenCentimetresAndTwoDegrees) {
  Scene scene(testing::RoomLines());
  Random random(7);
  for (int k = 0; k < 8; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = Render(scene.lines, truth, 100 + k);
    const Rigid3 prior = Disturb(truth, 0.10, 2.0 * kDegree, &random);
    const RefineResult result = scene.Refine(InputOf(segments, prior));
    EXPECT_EQ(ToString(result.status), "REFINED") << "query " << k;
    const PoseDistance error = DistanceBetween(result.cam_from_world, truth);
    EXPECT_LT(error.position_m, 0.01) << "query " << k;
    EXPECT_LT(error.rotation_rad, 0.2 * kDegree) << "query " << k;
    EXPECT_EQ(result.num_observed_directions, 6);
    EXPECT_GT(result.map_support, 0.3);
  }
}

TEST(PoseRefiner, RefinesAStreamWithoutSearch) {
  Scene scene(testing::RoomLines());
  Random random(8);
  for (int k = 0; k < 5; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = Render(scene.lines, truth, 200 + k);
    RefineInput input =
        InputOf(segments, Disturb(truth, 0.02, 0.5 * kDegree, &random), 0.02, 0.5 * kDegree);
    input.search = false;
    const RefineResult result = scene.Refine(input);
    EXPECT_EQ(ToString(result.status), "REFINED") << "query " << k;
    EXPECT_LT(DistanceBetween(result.cam_from_world, truth).position_m, 0.008) << "query " << k;
  }
}

TEST(PoseRefiner, MatchesAreOfTheMapAndNearTheirLines) {
  Scene scene(testing::RoomLines());
  Random random(9);
  const Rigid3 truth = QueryPose(2);
  const auto segments = Render(scene.lines, truth, 300);
  const RefineResult result =
      scene.Refine(InputOf(segments, Disturb(truth, 0.10, 2.0 * kDegree, &random)));
  ASSERT_GT(result.matches.size(), 15u);
  std::vector<int> uses(segments.size());
  double sum = 0.0;
  for (const LineMatch& match : result.matches) {
    ASSERT_LT(match.segment, segments.size());
    ASSERT_LT(match.line, scene.map.lines.size());
    EXPECT_EQ(++uses[match.segment], 1) << "segment " << match.segment << " explained twice";
    EXPECT_LT(match.distance_px, 6.0);
    sum += match.distance_px;
  }
  EXPECT_LT(sum / static_cast<double>(result.matches.size()), 1.0);
}

TEST(PoseRefiner, ExactPriorIsKeptToTheLastBit) {
  Scene scene(testing::RoomLines());
  for (int k = 0; k < 4; ++k) {
    const Rigid3 truth = QueryPose(k);
    const RefineResult result =
        scene.Refine(InputOf(Render(scene.lines, truth, 400 + k, {.noise_px = 0.0}), truth));
    EXPECT_EQ(ToString(result.status), "KEPT_PRIOR");
    EXPECT_TRUE(HaveSameBits(result.cam_from_world, truth));
  }
}

TEST(PoseRefiner, RandomSegmentsKeepThePriorAndItsCovariance) {
  Scene scene(testing::RoomLines());
  for (int k = 0; k < 5; ++k) {
    const auto segments = Render({}, QueryPose(k), 500 + k, {.num_clutter = 200});
    const Rigid3 prior = QueryPose(k);
    const RefineResult result = scene.Refine(InputOf(segments, prior));
    EXPECT_NE(ToString(result.status), "REFINED") << "query " << k;
    EXPECT_TRUE(HaveSameBits(result.cam_from_world, prior));
    EXPECT_NEAR(result.covariance(5, 5), 0.10 * 0.10 / 3, 1e-12);
  }
}

TEST(PoseRefiner, GravityFindsWhatFewHypothesesMiss) {
  Scene scene(testing::RoomLines(), {.num_hypotheses = 16});
  Random random(11);
  int found_without = 0, found_with = 0;
  constexpr int kTrials = 24;
  for (int k = 0; k < kTrials; ++k) {
    const Rigid3 truth = QueryPose(k % 8);
    const auto segments = Render(scene.lines, truth, 600 + k);
    RefineInput input =
        InputOf(segments, Disturb(truth, 0.3, 25.0 * kDegree, &random), 0.3, 25.0 * kDegree);
    input.seed = static_cast<uint64_t>(k);
    const auto is_found = [&] {
      return DistanceBetween(scene.Refine(input).cam_from_world, truth).position_m < 0.02;
    };
    found_without += is_found();
    input.prior.gravity =
        GravityPrior{.down_in_camera = 9.8 * (truth.rotation * Eigen::Vector3d::UnitZ()),
                     .down_in_world = Eigen::Vector3d::UnitZ(),
                     .sigma_rad = 0.5 * kDegree};
    found_with += is_found();
  }
  // 12 and 24 were found.
  EXPECT_LT(found_without, found_with - kTrials / 4);
  EXPECT_GT(found_with, kTrials * 3 / 4);
}

TEST(PoseRefiner, DrawsMoreHypothesesFromALargerPrior) {
  Scene scene(testing::RoomLines()), fixed(testing::RoomLines(), {.num_hypotheses = 700});
  const auto segments = Render(scene.lines, QueryPose(2), 650);
  const auto drawn = [&](Scene& of, double position_m, double rotation_deg) {
    Random random(12);
    const Rigid3 prior = Disturb(QueryPose(2), 0.04, 1.0 * kDegree, &random);
    const RefineResult result =
        of.Refine(InputOf(segments, prior, position_m, rotation_deg * kDegree));
    EXPECT_EQ(ToString(result.status), "REFINED");
    return result.stages.num_hypotheses;
  };
  EXPECT_EQ(drawn(scene, 0.05, 1.0), 500u);
  EXPECT_EQ(drawn(scene, 0.20, 2.0), 1000u);
  EXPECT_NEAR(drawn(scene, 0.05, 4.0), 1000.0, 5.0);
  EXPECT_EQ(drawn(scene, 0.40, 8.0), 1500u);
  EXPECT_EQ(drawn(fixed, 0.40, 8.0), 700u);
}

TEST(PoseRefiner, NoSegmentsIsLowSupport) {
  Scene scene(testing::RoomLines());
  const RefineResult result = scene.Refine(InputOf({}, QueryPose(0)));
  EXPECT_EQ(ToString(result.status), "LOW_SUPPORT");
  EXPECT_TRUE(result.matches.empty());
}

TEST(PoseRefiner, EmptyMapIsLowSupport) {
  Scene scene({});
  const auto segments = Render(testing::RoomLines(), QueryPose(0), 1);
  EXPECT_EQ(ToString(scene.Refine(InputOf(segments, QueryPose(0))).status), "LOW_SUPPORT");
}

TEST(PoseRefiner, ParallelLinesAreDegenerate) {
  std::vector<Segment3> vertical;
  for (const Segment3& line : testing::RoomLines()) {
    if (std::abs(line.Delta().normalized().z()) > 0.999) vertical.push_back(line);
  }
  Scene scene(vertical);
  Random random(11);
  for (int k = 0; k < 3; ++k) {
    const Rigid3 truth = QueryPose(k);
    const Rigid3 prior = Disturb(truth, 0.10, 2.0 * kDegree, &random);
    const auto segments = Render(vertical, truth, 600 + k, {.num_clutter = 5});
    const RefineResult result = scene.Refine(InputOf(segments, prior));
    EXPECT_EQ(ToString(result.status), "DEGENERATE") << "query " << k;
    EXPECT_EQ(result.num_observed_directions, 5);
    EXPECT_TRUE(HaveSameBits(result.cam_from_world, prior));
  }
}

TEST(PoseRefiner, RepeatedStructureIsAmbiguous) {
  Scene scene(testing::FenceLines(0.2));
  const Rigid3 truth = LookAlong({0.5, 0.05, 0.02}, {1.0, 0.05, 0.03});
  // Half a period to the side: two places explain the image equally well.
  Rigid3 prior = truth;
  prior.translation = -(prior.rotation * (truth.Center() + Eigen::Vector3d(0, 0.1, 0)));
  const auto segments = Render(scene.lines, truth, 700, {.missing_share = 0.0, .num_clutter = 0});
  const RefineResult result = scene.Refine(InputOf(segments, prior));
  EXPECT_EQ(ToString(result.status), "AMBIGUOUS");
  EXPECT_GT(result.runner_up_ratio, 0.97);
  EXPECT_TRUE(HaveSameBits(result.cam_from_world, prior));
}

TEST(PoseRefiner, WidensTheSearchWhenThePriorIsWorseThanItClaims) {
  Scene scene(testing::RoomLines());
  Random random(12);
  int refined = 0;
  for (int k = 0; k < 6; ++k) {
    const Rigid3 truth = QueryPose(k);
    const Rigid3 prior = Disturb(truth, 0.10, 2.5 * kDegree, &random);
    const RefineResult result =
        scene.Refine(InputOf(Render(scene.lines, truth, 800 + k), prior, 0.04, 1.0 * kDegree));
    if (result.status != RefineStatus::kRefined) continue;
    ++refined;
    EXPECT_LT(DistanceBetween(result.cam_from_world, truth).position_m, 0.01);
  }
  EXPECT_GE(refined, 5);
}

TEST(PoseRefiner, EqualInputsGiveEqualBits) {
  Scene scene(testing::RoomLines()), other(testing::RoomLines());
  Random random(13);
  const Rigid3 truth = QueryPose(1);
  const auto segments = Render(scene.lines, truth, 900);
  const RefineInput input =
      InputOf(segments, Disturb(truth, 0.2, 4.0 * kDegree, &random), 0.2, 4.0 * kDegree);
  const RefineResult first = scene.Refine(input);
  scene.Refine(InputOf(Render(scene.lines, QueryPose(3), 901), QueryPose(3)));
  const RefineResult again = scene.Refine(input);
  const RefineResult elsewhere = other.Refine(input);
  for (const RefineResult* result : {&again, &elsewhere}) {
    EXPECT_EQ(result->status, first.status);
    EXPECT_TRUE(HaveSameBits(result->cam_from_world, first.cam_from_world));
    EXPECT_EQ(std::memcmp(&result->covariance, &first.covariance, sizeof(first.covariance)), 0);
    EXPECT_EQ(result->matches.size(), first.matches.size());
  }
}

TEST(PoseRefiner, DoesNotAllocateOnceWarm) {
  Scene scene(testing::RoomLines());
  Random random(14);
  RefineResult result;
  const auto refine_all = [&](const std::vector<RefineInput>& inputs) {
    for (const RefineInput& input : inputs) ASSERT_TRUE(scene.refiner->Refine(input, &result));
  };
  std::vector<std::vector<Segment2>> segments;
  for (int k = 0; k < 3; ++k) segments.push_back(Render(scene.lines, QueryPose(k), 1000 + k));
  std::vector<RefineInput> inputs;
  for (int k = 0; k < 3; ++k) {
    inputs.push_back(InputOf(segments[k], Disturb(QueryPose(k), 0.1, 2.0 * kDegree, &random)));
    inputs.push_back(inputs.back());
    inputs.back().search = false;
  }
  refine_all(inputs);
  const size_t before = testing::num_allocations;
  refine_all(inputs);
  EXPECT_EQ(testing::num_allocations - before, 0u);
}

TEST(PoseRefiner, CovarianceIsOfTheErrorsSize) {
  Scene scene(testing::RoomLines());
  Random random(15);
  std::vector<double> squares;
  for (int k = 0; k < 24; ++k) {
    const Rigid3 truth = QueryPose(k % 8);
    const Rigid3 prior = Disturb(truth, 0.05, 1.0 * kDegree, &random);
    const RefineResult result =
        scene.Refine(InputOf(Render(scene.lines, truth, 1100 + k), prior, 0.05, 1.0 * kDegree));
    if (result.status != RefineStatus::kRefined) continue;
    const Vector6d error = Difference(truth, result.cam_from_world);
    squares.push_back(error.dot(result.covariance.llt().solve(error)));
  }
  ASSERT_GT(squares.size(), 20u);
  std::nth_element(squares.begin(), squares.begin() + squares.size() / 2, squares.end());
  // The median of chi-square with 6 degrees of freedom is 5.35; a factor of 8 either way, since
  // the map claims an uncertainty that it does not have.
  EXPECT_GT(squares[squares.size() / 2], 5.35 / 8);
  EXPECT_LT(squares[squares.size() / 2], 5.35 * 8);
}

TEST(PoseRefiner, PointsTakePartInTheRefinement) {
  Scene scene(testing::RoomLines());
  Random random(16);
  const Rigid3 truth = QueryPose(2);
  const auto segments = Render(scene.lines, truth, 1200);
  const auto points = RenderPoints(truth, 200, 0.2, 1);
  RefineInput input = InputOf(segments, Disturb(truth, 0.1, 2.0 * kDegree, &random));
  input.points = points;
  const RefineResult result = scene.Refine(input);
  EXPECT_EQ(ToString(result.status), "REFINED");
  EXPECT_GT(result.num_points_used, 140u);
  EXPECT_LT(result.num_points_used, 180u);
  EXPECT_LT(DistanceBetween(result.cam_from_world, truth).position_m, 0.004);
}

TEST(PoseRefiner, ManyPointsDecideWhereLinesDoNot) {
  Scene scene(testing::RoomLines());
  Random random(17);
  const Rigid3 truth = QueryPose(3);
  const auto points = RenderPoints(truth, 150, 0.25, 2);
  RefineInput input = InputOf({}, Disturb(truth, 0.1, 2.0 * kDegree, &random));
  input.points = points;
  const RefineResult result = scene.Refine(input);
  EXPECT_EQ(ToString(result.status), "REFINED");
  EXPECT_LT(DistanceBetween(result.cam_from_world, truth).position_m, 0.005);
  EXPECT_EQ(result.num_observed_directions, 6);
}

TEST(PoseRefiner, LinesContradictPointsThatHoldAnotherPose) {
  Scene scene(testing::RoomLines(), {.num_hypotheses = 500});
  Random random(19);
  for (int k = 0; k < 5; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = Render(scene.lines, truth, 1250 + k);
    // As many points as decide where lines do not, all of them on something that has moved.
    const auto points = RenderPoints(Disturb(truth, 0.2, 3.0 * kDegree, &random), 150, 0.1, 4);
    RefineInput input = InputOf(segments, Disturb(truth, 0.1, 2.0 * kDegree, &random));
    input.points = points;
    const RefineResult result = scene.Refine(input);
    EXPECT_EQ(ToString(result.status), "REFINED") << "query " << k;
    EXPECT_LT(DistanceBetween(result.cam_from_world, truth).position_m, 0.03) << "query " << k;
  }
}

TEST(PoseRefiner, WrongPointsDoNotMoveThePose) {
  Scene scene(testing::RoomLines());
  const auto points = RenderPoints(QueryPose(3), 150, 1.0, 3);
  RefineInput input = InputOf({}, QueryPose(3));
  input.points = points;
  for (size_t i = 0; i < points.size(); ++i) {
    const_cast<PointMatch&>(points[i]).pixel = points[(i * 7 + 3) % points.size()].pixel;
  }
  const RefineResult result = scene.Refine(input);
  EXPECT_EQ(ToString(result.status), "LOW_SUPPORT");
  EXPECT_TRUE(HaveSameBits(result.cam_from_world, input.prior.cam_from_world));
}

TEST(PaperMethod, RefinesASmallErrorOfFullLines) {
  Scene scene(testing::RoomLines(), {.method = RefineMethod::kPaper});
  Random random(18);
  int better = 0;
  for (int k = 0; k < 5; ++k) {
    const Rigid3 truth = QueryPose(k);
    const Rigid3 prior = Disturb(truth, 0.01, 0.2 * kDegree, &random);
    const auto segments = Render(scene.lines, truth, 1300 + k,
                                 {.missing_share = 0.0, .fragment_share = 0.0, .num_clutter = 0});
    const RefineResult result = scene.Refine(InputOf(segments, prior, 0.02, 0.5 * kDegree));
    if (result.status != RefineStatus::kRefined) {
      EXPECT_TRUE(HaveSameBits(result.cam_from_world, prior));
      continue;
    }
    better += DistanceBetween(result.cam_from_world, truth).position_m < 0.01 ? 1 : 0;
  }
  EXPECT_GE(better, 3);
}

TEST(PaperMethod, RandomSegmentsKeepThePrior) {
  Scene scene(testing::RoomLines(), {.method = RefineMethod::kPaper});
  const auto segments = Render({}, QueryPose(0), 1400, {.num_clutter = 200});
  const RefineResult result = scene.Refine(InputOf(segments, QueryPose(0)));
  EXPECT_NE(ToString(result.status), "REFINED");
  EXPECT_TRUE(HaveSameBits(result.cam_from_world, QueryPose(0)));
}

std::string ErrorOf(const RefineInput& input) {
  static Scene scene(testing::RoomLines());
  RefineResult result;
  const Status status = scene.refiner->Refine(input, &result);
  if (status) return "";
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  return status.error().message;
}

TEST(PoseRefinerInput, BadPriorsAreNamed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  RefineInput input = InputOf({}, QueryPose(0));
  input.prior.cam_from_world.translation.y() = nan;
  EXPECT_THAT(ErrorOf(input), HasSubstr("prior: translation"));
  EXPECT_THAT(ErrorOf(input), HasSubstr("nan"));
  input = InputOf({}, QueryPose(0));
  input.prior.cam_from_world.rotation.w() = nan;
  EXPECT_THAT(ErrorOf(input), HasSubstr("prior: rotation"));
  input = InputOf({}, QueryPose(0));
  input.prior.cam_from_world.rotation.coeffs() *= 2.0;
  EXPECT_THAT(ErrorOf(input), HasSubstr("unit quaternion"));
  input = InputOf({}, QueryPose(0), 0.0);
  EXPECT_THAT(ErrorOf(input), HasSubstr("prior.position_sigma_m 0 "));
  input = InputOf({}, QueryPose(0), 0.1, -0.5);
  EXPECT_THAT(ErrorOf(input), HasSubstr("-0.5"));
}

TEST(PoseRefinerInput, BadCamerasSegmentsAndPointsAreNamed) {
  RefineInput input = InputOf({}, QueryPose(0));
  input.camera.fx = 0.0;
  EXPECT_THAT(ErrorOf(input), HasSubstr("camera"));
  const std::vector<Segment2> segments = {{{1, 2}, {30, 40}},
                                          {{1, std::numeric_limits<double>::infinity()}, {30, 40}}};
  EXPECT_THAT(ErrorOf(InputOf(segments, QueryPose(0))), HasSubstr("segment 1"));
  std::vector<PointMatch> points(3);
  points[2].point_in_world.x() = std::numeric_limits<double>::quiet_NaN();
  input = InputOf({}, QueryPose(0));
  input.points = points;
  EXPECT_THAT(ErrorOf(input), HasSubstr("points[2]"));
}

TEST(PoseRefinerInput, SegmentsWithoutLengthAreHarmless) {
  std::vector<Segment2> segments(20, Segment2{{100, 100}, {100, 100}});
  EXPECT_EQ(ErrorOf(InputOf(segments, QueryPose(0))), "");
}

TEST(PoseRefinerBudget, AnEndlessOneChangesNoBit) {
  Scene free(testing::RoomLines());
  Scene bounded(testing::RoomLines(), {.time_budget_ns = 3'600'000'000'000});
  Random random(21);
  for (int k = 0; k < 4; ++k) {
    const auto segments = Render(free.lines, QueryPose(k), 400 + k);
    const Rigid3 prior = Disturb(QueryPose(k), 0.10, 2.0 * kDegree, &random);
    const RefineResult a = free.Refine(InputOf(segments, prior));
    const RefineResult b = bounded.Refine(InputOf(segments, prior));
    EXPECT_TRUE(HaveSameBits(a.cam_from_world, b.cam_from_world));
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_FALSE(b.stages.out_of_time);
  }
}

TEST(PoseRefinerBudget, OneThatIsSpentAtOnceLeavesTheGateInPlace) {
  Scene scene(testing::RoomLines(), {.time_budget_ns = 1});
  Random random(22);
  for (int k = 0; k < 4; ++k) {
    const auto segments = Render(scene.lines, QueryPose(k), 500 + k);
    const Rigid3 prior = Disturb(QueryPose(k), 0.10, 2.0 * kDegree, &random);
    const RefineResult result = scene.Refine(InputOf(segments, prior));
    EXPECT_TRUE(result.stages.out_of_time);
    EXPECT_LE(result.stages.num_hypotheses, 96u);
    // What is left is a search all the same: the pose is better, or the prior to the last bit.
    const double before = DistanceBetween(prior, QueryPose(k)).position_m;
    const double after = DistanceBetween(result.cam_from_world, QueryPose(k)).position_m;
    if (result.status == RefineStatus::kRefined) {
      EXPECT_LT(after, before);
      EXPECT_GT(result.matches.size(), 10u);
    } else {
      EXPECT_TRUE(HaveSameBits(result.cam_from_world, prior));
    }
  }
}

TEST(PoseRefinerBudget, AWeakPoseWithoutTimeForItsRivalsIsAmbiguous) {
  // Posts all alike, of which most are missing: what little is found fits at several places.
  const std::vector<Segment3> lines = testing::FenceLines(0.5);
  std::vector<Rigid3> key_frames;
  for (int k = 0; k < 9; ++k) key_frames.push_back(LookAlong({0, -2.0 + 0.5 * k, 0}, {1, 0, 0}));
  Scene bounded(lines, {.time_budget_ns = 1}, key_frames);
  Random random(9);
  int weak = 0;
  for (int k = 0; k < 40; ++k) {
    const Rigid3 truth = LookAlong({0.1, 0.02 * k - 0.4, 0.05}, {1, 0.05, 0});
    const auto segments = Render(lines, truth, 50 + k, {.missing_share = 0.6, .num_clutter = 60});
    Rigid3 prior = Disturb(truth, 0.1, 2.0 * kDegree, &random);
    prior.translation.x() += k % 2 == 0 ? -0.45 : 0.45;
    const RefineInput input = InputOf(segments, prior, 0.25, 3.0 * kDegree);
    const RefineResult result = bounded.Refine(input);
    if (result.status == RefineStatus::kRefined) {
      EXPECT_GE(result.evidence_nats, 15.0) << "query " << k;
    } else {
      EXPECT_TRUE(HaveSameBits(result.cam_from_world, prior)) << "query " << k;
    }
    // Nothing else found was as good: only the rivals that nobody looked for speak against it.
    weak += result.status == RefineStatus::kAmbiguous && result.evidence_nats > 8.0 &&
            result.runner_up_ratio < 0.5;
  }
  EXPECT_GE(weak, 3);
}

TEST(PoseRefiner, ATiltThatGravityRightsIsReturned) {
  Scene scene(testing::RoomLines());
  for (int k = 0; k < 8; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = Render(scene.lines, truth, 600 + k, {.noise_px = 0.3});
    // Only the tilt is off: with gravity the prior is as good as what the lines say.
    const Eigen::Quaterniond tilted =
        (ExpSo3(Eigen::Vector3d(2.0 * kDegree, 0.0, 0.0)) * truth.rotation).normalized();
    RefineInput input =
        InputOf(segments, {tilted, -(tilted * truth.Center())}, 0.05, 2.0 * kDegree);
    input.prior.gravity =
        GravityPrior{truth.rotation * -Eigen::Vector3d::UnitZ(), -Eigen::Vector3d::UnitZ(), 1e-5};
    const RefineResult result = scene.Refine(input);
    EXPECT_EQ(ToString(result.status), "REFINED") << "query " << k;
    EXPECT_LT(DistanceBetween(result.cam_from_world, truth).rotation_rad, 0.3 * kDegree)
        << "query " << k;
  }
}

TEST(PoseRefinerOptions, OutOfRangeValuesAreRefused) {
  const LineMap map;
  const MapIndex index(map);
  EXPECT_THAT(PoseRefiner::Create(index, {.num_hypotheses = 0}).error().message,
              HasSubstr("num_hypotheses 0"));
  EXPECT_THAT(PoseRefiner::Create(index, {.num_hypotheses = 4096}).error().message,
              HasSubstr("4096"));
  EXPECT_THAT(PoseRefiner::Create(index, {.min_map_support = 1.5}).error().message,
              HasSubstr("min_map_support"));
  EXPECT_THAT(PoseRefiner::Create(index, {.time_budget_ns = -5}).error().message,
              HasSubstr("time_budget_ns -5"));
  EXPECT_THAT(
      PoseRefiner::Create(index, {.method = RefineMethod::kPaper, .time_budget_ns = 1'000'000})
          .error()
          .message,
      HasSubstr("time_budget_ns 1000000"));
}

}  // namespace
}  // namespace plumb
