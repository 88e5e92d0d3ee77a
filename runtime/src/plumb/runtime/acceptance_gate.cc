#include "plumb/runtime/acceptance_gate.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plumb/refine/uncertainty.h"

namespace plumb {
namespace {

constexpr uint32_t kMinTried = 20;
constexpr double kDistinctPositionM = 0.02, kDistinctRotationRad = 0.01;
constexpr double kMaxDeviations = 3.0;
constexpr double kTightPositionM = 0.10, kTightRotationRad = 0.035;
constexpr double kMinGain = 4.0;

}  // namespace

uint32_t CountDistinctPoses(const PosePrior& prior, uint32_t num_hypotheses) {
  // Per axis, cells of twice the distance between one deviation on either side.
  const double rotation =
      1.0 + prior.rotation_sigma_rad / std::numbers::sqrt3 / kDistinctRotationRad;
  const double position = 1.0 + prior.position_sigma_m / std::numbers::sqrt3 / kDistinctPositionM;
  return static_cast<uint32_t>(
      std::min<double>(num_hypotheses, std::pow(rotation * position, 3.0)));
}

double EvidenceToBeat(uint32_t num_tried) {
  return std::log(static_cast<double>(std::max(num_tried, kMinTried)));
}

bool IsClearlyDifferent(const Rigid3& a_from_world, const Rigid3& b_from_world) {
  const PoseDistance distance = DistanceBetween(a_from_world, b_from_world);
  return distance.position_m > kDifferentPositionM || distance.rotation_rad > kDifferentRotationRad;
}

bool IsPlausible(const Rigid3& cam_from_world, const PosePrior& prior) {
  const PoseDistance distance = DistanceBetween(cam_from_world, prior.cam_from_world);
  return distance.position_m < kMaxDeviations * prior.position_sigma_m &&
         distance.rotation_rad < kMaxDeviations * prior.rotation_sigma_rad;
}

int CountObservedDirections(const Matrix6d& information, const PosePrior& prior) {
  const Matrix6d prior_information =
      PriorCovariance(std::max(prior.rotation_sigma_rad, kTightRotationRad),
                      std::max(prior.position_sigma_m, kTightPositionM))
          .diagonal()
          .cwiseInverse()
          .asDiagonal();
  return Observe(information / kMinGain, prior_information).num_observed;
}

RefineStatus Decide(const GateEvidence& evidence, const GateOptions& options) {
  // Written so that NaN never refines.
  if (!(evidence.evidence_nats >= options.min_evidence_nats) ||
      !(evidence.refined.map_share >= options.min_map_support)) {
    return RefineStatus::kLowSupport;
  }
  if (options.needs_all_directions && evidence.num_observed_directions < 6) {
    return RefineStatus::kDegenerate;
  }
  if (!(evidence.refined.Value() >= options.min_gain * evidence.prior.Value())) {
    return RefineStatus::kKeptPrior;
  }
  if (!(evidence.runner_up_ratio <= options.max_runner_up_ratio) || !evidence.is_near_prior) {
    return RefineStatus::kAmbiguous;
  }
  return RefineStatus::kRefined;
}

}  // namespace plumb
