#include "plumb/runtime/prior_choice.h"

#include <algorithm>
#include <cassert>

#include "plumb/runtime/acceptance_gate.h"

namespace plumb {
namespace {

bool IsBetter(const PriorOutcome& a, const PriorOutcome& b) {
  const bool a_refined = a.status == RefineStatus::kRefined;
  const bool b_refined = b.status == RefineStatus::kRefined;
  if (a_refined != b_refined) return a_refined;
  const bool a_by_points = a.num_deciding_points > 0, b_by_points = b.num_deciding_points > 0;
  if (a_by_points != b_by_points) return b_by_points;
  return a_by_points ? a.num_deciding_points > b.num_deciding_points
                     : a.evidence_nats > b.evidence_nats;
}

// Keeps ratios finite [nats].
constexpr double kMinNats = 1e-3;

// How strongly another prior's outcome speaks against the chosen one, which is refined.
double RivalRatio(const PriorOutcome& chosen, const PriorOutcome& other) {
  if (!other.cam_from_world) return 0.0;
  const bool is_elsewhere = IsClearlyDifferent(*other.cam_from_world, *chosen.cam_from_world);
  if (other.num_deciding_points > 0) return is_elsewhere ? 1.0 : 0.0;
  if (chosen.num_deciding_points > 0) return 0.0;  // Lines say less than points that decide.
  if (!is_elsewhere) return other.runner_up_ratio;
  return other.evidence_nats / std::max(chosen.evidence_nats, kMinNats);
}

}  // namespace

PriorChoice ChoosePrior(std::span<const PriorOutcome> outcomes) {
  assert(!outcomes.empty());
  PriorChoice choice;
  for (size_t k = 1; k < outcomes.size(); ++k) {
    if (IsBetter(outcomes[k], outcomes[choice.prior])) choice.prior = k;
  }
  const PriorOutcome& chosen = outcomes[choice.prior];
  choice.status = chosen.status;
  choice.runner_up_ratio = chosen.runner_up_ratio;
  if (chosen.status != RefineStatus::kRefined) return choice;
  double rival = 0.0;
  for (size_t k = 0; k < outcomes.size(); ++k) {
    if (k != choice.prior) rival = std::max(rival, RivalRatio(chosen, outcomes[k]));
  }
  choice.runner_up_ratio = std::max(choice.runner_up_ratio, rival);
  if (rival > MaxRunnerUpRatio(chosen.evidence_nats)) choice.status = RefineStatus::kAmbiguous;
  return choice;
}

}  // namespace plumb
