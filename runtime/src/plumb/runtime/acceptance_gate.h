// The acceptance gate: when a refined pose may replace the prior.
#pragma once

#include <cstddef>

#include "plumb/matching/support.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// What speaks for and against a refined pose. Supports are measured on the same lines.
struct GateEvidence {
  PoseSupport refined, prior;
  double runner_up_ratio = 0.0;     // value of the best clearly different pose over the refined's
  size_t num_pairs = 0;             // line-segment pairs that hold the refined pose
  int num_observed_directions = 0;  // of 6
};

struct GateOptions {
  double min_map_support = 0.12;
  double min_gain = 1.03;  // of the support's value over the prior's; 1.00 in a stream
  /// The lines must determine all six directions better than the prior does. Not in a stream, whose
  /// prediction is good to 2 cm: there the prior may hold what the lines leave open.
  bool needs_all_directions = true;
};

/// Poses farther apart than this are clearly different.
inline constexpr double kDifferentPositionM = 0.05, kDifferentRotationRad = 0.02;
bool IsClearlyDifferent(const Rigid3& a_from_world, const Rigid3& b_from_world);

/// @return kRefined unless a rule of docs/method/association.md ("Status") speaks against it.
RefineStatus Decide(const GateEvidence& evidence, const GateOptions& options);

}  // namespace plumb
