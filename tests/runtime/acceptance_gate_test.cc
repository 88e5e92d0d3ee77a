#include "plumb/runtime/acceptance_gate.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace plumb {
namespace {

GateEvidence GoodEvidence() {
  GateEvidence evidence;
  evidence.refined = {1000.0, 0.5};
  evidence.prior = {300.0, 0.2};
  evidence.runner_up_ratio = 0.4;
  evidence.evidence_nats = 60.0;
  evidence.num_observed_directions = 6;
  return evidence;
}

TEST(Decide, GoodEvidenceRefines) { EXPECT_EQ(Decide(GoodEvidence(), {}), RefineStatus::kRefined); }

TEST(Decide, WhatChanceMayReachIsLowSupport) {
  GateEvidence evidence = GoodEvidence();
  evidence.evidence_nats = 6.9;
  EXPECT_EQ(Decide(evidence, {.min_evidence_nats = 7.0}), RefineStatus::kLowSupport);
  EXPECT_EQ(Decide(evidence, {.min_evidence_nats = 6.8}), RefineStatus::kRefined);
}

TEST(EvidenceToBeat, GrowsWithThePosesTried) {
  EXPECT_DOUBLE_EQ(EvidenceToBeat(1), std::log(20.0));
  EXPECT_DOUBLE_EQ(EvidenceToBeat(20), std::log(20.0));
  EXPECT_DOUBLE_EQ(EvidenceToBeat(1500), std::log(1500.0));
}

TEST(CountDistinctPoses, ATightPriorHasFew) {
  const auto count = [](double position_m, double rotation_rad) {
    return CountDistinctPoses({{}, position_m, rotation_rad}, 2048);
  };
  EXPECT_EQ(count(1e-6, 1e-6), 1u);
  EXPECT_LT(count(0.05, 0.0175), 200u);
  EXPECT_GT(count(0.10, 0.0349), 1000u);
  EXPECT_EQ(count(0.40, 0.14), 2048u);  // no more than are drawn
}

TEST(Decide, ASmallShareOfTheMapIsLowSupport) {
  GateEvidence evidence = GoodEvidence();
  evidence.refined.map_share = 0.11;
  EXPECT_EQ(Decide(evidence, {.min_map_support = 0.12}), RefineStatus::kLowSupport);
  EXPECT_EQ(Decide(evidence, {.min_map_support = 0.10}), RefineStatus::kRefined);
}

TEST(Decide, ThePriorStaysUnlessTheSupportGrows) {
  GateEvidence evidence = GoodEvidence();
  evidence.prior = evidence.refined;
  EXPECT_EQ(Decide(evidence, {.min_gain = 1.03}), RefineStatus::kKeptPrior);
  EXPECT_EQ(Decide(evidence, {.min_gain = 1.00}), RefineStatus::kRefined);
}

TEST(Decide, ARunnerUpAsGoodIsAmbiguous) {
  GateEvidence evidence = GoodEvidence();
  evidence.runner_up_ratio = 0.98;
  EXPECT_EQ(Decide(evidence, {}), RefineStatus::kAmbiguous);
}

TEST(Decide, APoseThatContradictsThePriorIsAmbiguous) {
  GateEvidence evidence = GoodEvidence();
  evidence.is_near_prior = false;
  EXPECT_EQ(Decide(evidence, {}), RefineStatus::kAmbiguous);
}

TEST(Decide, AnUnobservedDirectionIsDegenerateWhereAllAreNeeded) {
  GateEvidence evidence = GoodEvidence();
  evidence.num_observed_directions = 5;
  EXPECT_EQ(Decide(evidence, {.needs_all_directions = true}), RefineStatus::kDegenerate);
  EXPECT_EQ(Decide(evidence, {.needs_all_directions = false}), RefineStatus::kRefined);
}

TEST(Decide, NotANumberNeverRefines) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  GateEvidence evidence = GoodEvidence();
  evidence.refined.map_share = nan;
  EXPECT_EQ(Decide(evidence, {}), RefineStatus::kLowSupport);
  evidence = GoodEvidence();
  evidence.evidence_nats = nan;
  EXPECT_EQ(Decide(evidence, {}), RefineStatus::kLowSupport);
  evidence = GoodEvidence();
  evidence.refined.detected_px = nan;
  EXPECT_EQ(Decide(evidence, {}), RefineStatus::kKeptPrior);
}

Rigid3 At(double x, double turn) { return {ExpSo3({0, turn, 0}), {x, 0, 0}}; }

TEST(IsClearlyDifferent, InPositionOrInRotation) {
  EXPECT_FALSE(IsClearlyDifferent(At(0, 0), At(0.04, 0)));
  EXPECT_TRUE(IsClearlyDifferent(At(0, 0), At(0.06, 0)));
  EXPECT_FALSE(IsClearlyDifferent(At(0, 0), At(0, 0.019)));
  EXPECT_TRUE(IsClearlyDifferent(At(0, 0), At(0, 0.021)));
}

TEST(IsPlausible, WithinThreeDeviations) {
  const PosePrior prior{At(0, 0), 0.1, 0.03};
  EXPECT_TRUE(IsPlausible(At(0.29, 0.0), prior));
  EXPECT_FALSE(IsPlausible(At(0.31, 0.0), prior));
  EXPECT_TRUE(IsPlausible(At(0, 0.089), prior));
  EXPECT_FALSE(IsPlausible(At(0, 0.091), prior));
}

TEST(CountObservedDirections, IgnoresHowTightThePriorIs) {
  // 4 times the information of 10 cm / 2 deg, component by component: 1200 and 9800.
  Vector6d information;
  information << 1e5, 1e5, 5000.0, 2000.0, 2000.0, 1000.0;
  const Matrix6d matrix = information.asDiagonal();
  EXPECT_EQ(CountObservedDirections(matrix, {At(0, 0), 0.10, 0.035}), 4);
  EXPECT_EQ(CountObservedDirections(matrix, {At(0, 0), 0.001, 0.0001}), 4);
  EXPECT_EQ(CountObservedDirections(matrix, {At(0, 0), 0.4, 0.14}), 6);
}

}  // namespace
}  // namespace plumb
