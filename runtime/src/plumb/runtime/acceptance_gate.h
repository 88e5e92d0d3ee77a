// The acceptance gate: when a refined pose may replace the prior.
#pragma once

#include <cstdint>

#include "plumb/geometry/rigid3.h"
#include "plumb/matching/support.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// What speaks for and against a refined pose. Supports are measured on the same lines.
struct GateEvidence {
  PoseSupport refined, prior;
  double runner_up_ratio = 0.0;     // value of the best clearly different pose over the refined's
  bool is_near_prior = true;        // IsPlausible()
  double evidence_nats = 0.0;       // of the refined pose, MatchEvidence
  int num_observed_directions = 0;  // of 6
};

/// A clearly different pose with more than this share of a pose's support leaves open which of both
/// it is.
inline constexpr double kMaxRunnerUpRatio = 0.97;
/// Below so much evidence a pose is weak: a rival needs only this share of its support to make it
/// ambiguous, and it is worth looking for one farther off than the prior says. Weak poses
/// that were right had rivals of 0.77 at most, a staircase one step off has one of 0.86 and more
/// (docs/adr/0008).
inline constexpr double kWeakNats = 15.0, kWeakRunnerUpRatio = 0.85;

/// The largest share that a rival may have of a pose with so much evidence.
inline double MaxRunnerUpRatio(double evidence_nats) {
  return evidence_nats < kWeakNats ? kWeakRunnerUpRatio : kMaxRunnerUpRatio;
}

struct GateOptions {
  double min_map_support = 0.05;
  /// EvidenceToBeat() of the poses that were tried.
  double min_evidence_nats = 3.0;
  double max_runner_up_ratio = kMaxRunnerUpRatio;
  double min_gain = 1.03;  // of the support's value over the prior's; 1.00 in a stream
  /// The lines must determine all six directions better than the prior does. Not in a stream, whose
  /// prediction is good to 2 cm: there the prior may hold what the lines leave open.
  bool needs_all_directions = true;
};

/// How many of `num_hypotheses` poses drawn from the prior can be told apart, 2 cm or 0.01 rad from
/// each other: draws from a tight prior lead to the same place.
uint32_t CountDistinctPoses(const PosePrior& prior, uint32_t num_hypotheses);

/// Evidence that the best of `num_tried` poses reaches by chance less than once: its logarithm, and
/// never less than log 20, so that a single wrong pose passes in one frame of twenty at most.
double EvidenceToBeat(uint32_t num_tried);

/// Poses farther apart than this are clearly different.
inline constexpr double kDifferentPositionM = 0.05, kDifferentRotationRad = 0.02;
bool IsClearlyDifferent(const Rigid3& a_from_world, const Rigid3& b_from_world);

/// Whether a pose is less than 3 deviations from the prior, in position and in rotation. A prior
/// may be worse than it claims, but a pose that contradicts it is more likely another place that
/// looks alike.
bool IsPlausible(const Rigid3& cam_from_world, const PosePrior& prior);

/// Of 6, directions of the pose that matches of this information determine: four times better than
/// a prior would that is no tighter than 10 cm / 2 deg. The factor is for the fused lines' own
/// errors of direction, which make parallel lines look a little less parallel; a tighter prior must
/// not make good lines look bad.
/// @param information  Scaled to the residuals' real size.
int CountObservedDirections(const Matrix6d& information, const PosePrior& prior);

/// @return kRefined unless a rule of docs/method/association.md ("Status") speaks against it.
RefineStatus Decide(const GateEvidence& evidence, const GateOptions& options);

}  // namespace plumb
