// The choice between what was found around several priors.
#include "plumb/runtime/prior_choice.h"

#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

Rigid3 At(double x_m) { return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x_m, 0.0, 0.0)}; }

PriorOutcome Found(RefineStatus status, double x_m, double nats, double runner_up_ratio = 0.0) {
  PriorOutcome outcome;
  outcome.status = status;
  outcome.cam_from_world = At(x_m);
  outcome.evidence_nats = nats;
  outcome.runner_up_ratio = runner_up_ratio;
  return outcome;
}

PriorOutcome ByPoints(double x_m, size_t num_points) {
  PriorOutcome outcome = Found(RefineStatus::kRefined, x_m, 0.0);
  outcome.num_deciding_points = num_points;
  return outcome;
}

using enum RefineStatus;

void ExpectChoice(const std::vector<PriorOutcome>& outcomes, size_t prior, RefineStatus status) {
  const PriorChoice choice = ChoosePrior(outcomes);
  EXPECT_EQ(choice.prior, prior);
  EXPECT_EQ(ToString(choice.status), ToString(status));
}

TEST(PriorChoice, OnePriorDecidesForItself) {
  for (const RefineStatus status : {kRefined, kKeptPrior, kAmbiguous, kDegenerate, kLowSupport}) {
    ExpectChoice({Found(status, 0.0, 30.0)}, 0, status);
  }
  EXPECT_EQ(ChoosePrior(std::vector{Found(kRefined, 0.0, 30.0, 0.4)}).runner_up_ratio, 0.4);
  ExpectChoice({PriorOutcome{}}, 0, kLowSupport);
}

TEST(PriorChoice, TheRefinedOneWithTheMostEvidenceWins) {
  ExpectChoice({Found(kLowSupport, 0.0, 1.0), Found(kRefined, 1.0, 30.0)}, 1, kRefined);
  ExpectChoice({Found(kRefined, 0.0, 30.0), Found(kRefined, 1.0, 80.0)}, 1, kRefined);
  ExpectChoice({Found(kRefined, 1.0, 80.0), PriorOutcome{}, Found(kRefined, 0.0, 30.0)}, 0,
               kRefined);
  // Of one place, and equal: the first.
  ExpectChoice({Found(kRefined, 0.0, 30.0), Found(kRefined, 0.01, 30.0)}, 0, kRefined);
}

TEST(PriorChoice, ARivalElsewhereMakesItAmbiguousWhateverBecameOfIt) {
  for (const RefineStatus status : {kRefined, kKeptPrior, kAmbiguous, kDegenerate, kLowSupport}) {
    const std::vector outcomes = {Found(kRefined, 0.0, 80.0), Found(status, 1.0, 79.0)};
    ExpectChoice(outcomes, 0, kAmbiguous);
    EXPECT_NEAR(ChoosePrior(outcomes).runner_up_ratio, 79.0 / 80.0, 1e-12);
  }
  ExpectChoice({Found(kDegenerate, 0.0, 90.0), Found(kRefined, 1.0, 80.0)}, 1, kAmbiguous);
  ExpectChoice({Found(kRefined, 0.0, 80.0), Found(kAmbiguous, 1.0, 20.0)}, 0, kRefined);
}

TEST(PriorChoice, WeakPosesNeedAClearLead) {
  ExpectChoice({Found(kRefined, 0.0, 10.0), Found(kLowSupport, 1.0, 9.0)}, 0, kAmbiguous);
  ExpectChoice({Found(kRefined, 0.0, 10.0), Found(kLowSupport, 1.0, 5.0)}, 0, kRefined);
}

TEST(PriorChoice, AnotherPriorOfTheSamePlaceConfirmsIt) {
  // One contradicts its own prior, which is wrong; the other one does not.
  ExpectChoice({Found(kAmbiguous, 0.0, 80.0), Found(kRefined, 0.01, 79.0)}, 1, kRefined);
  // It has seen a rival that the first search has missed.
  ExpectChoice({Found(kRefined, 0.0, 80.0, 0.3), Found(kAmbiguous, 0.01, 79.0, 0.99)}, 0,
               kAmbiguous);
}

TEST(PriorChoice, TheBestFailureSaysWhy) {
  ExpectChoice({Found(kLowSupport, 0.0, 2.0), Found(kAmbiguous, 1.0, 40.0)}, 1, kAmbiguous);
  ExpectChoice({PriorOutcome{}, PriorOutcome{}}, 0, kLowSupport);
}

TEST(PriorChoice, PointsDecideWhereNoLinesDo) {
  ExpectChoice({Found(kLowSupport, 0.0, 2.0), ByPoints(1.0, 50)}, 1, kRefined);
  ExpectChoice({ByPoints(0.0, 50), ByPoints(0.01, 90)}, 1, kRefined);
  ExpectChoice({ByPoints(0.0, 50), Found(kRefined, 0.01, 30.0)}, 1, kRefined);
  // At another place they contradict the lines, and each other.
  ExpectChoice({ByPoints(0.0, 50), Found(kRefined, 1.0, 30.0)}, 1, kAmbiguous);
  ExpectChoice({ByPoints(0.0, 50), ByPoints(1.0, 90)}, 1, kAmbiguous);
}

TEST(PriorChoice, NoEvidenceAtAllGivesANumber) {
  const auto choice =
      ChoosePrior(std::vector{Found(kRefined, 0.0, 0.0), Found(kLowSupport, 1.0, 0.0)});
  EXPECT_EQ(choice.runner_up_ratio, 0.0);
}

}  // namespace
}  // namespace plumb
