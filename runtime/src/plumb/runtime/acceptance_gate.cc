#include "plumb/runtime/acceptance_gate.h"

namespace plumb {
namespace {

constexpr size_t kMinPairs = 10;
constexpr double kMaxRunnerUpRatio = 0.97;

}  // namespace

bool IsClearlyDifferent(const Rigid3& a_from_world, const Rigid3& b_from_world) {
  const PoseDistance distance = DistanceBetween(a_from_world, b_from_world);
  return distance.position_m > kDifferentPositionM || distance.rotation_rad > kDifferentRotationRad;
}

RefineStatus Decide(const GateEvidence& evidence, const GateOptions& options) {
  // Written so that NaN never refines.
  if (evidence.num_pairs < kMinPairs || !(evidence.refined.map_share >= options.min_map_support)) {
    return RefineStatus::kLowSupport;
  }
  if (options.needs_all_directions && evidence.num_observed_directions < 6) {
    return RefineStatus::kDegenerate;
  }
  if (!(evidence.refined.Value() >= options.min_gain * evidence.prior.Value())) {
    return RefineStatus::kKeptPrior;
  }
  if (evidence.runner_up_ratio > kMaxRunnerUpRatio) return RefineStatus::kAmbiguous;
  return RefineStatus::kRefined;
}

}  // namespace plumb
