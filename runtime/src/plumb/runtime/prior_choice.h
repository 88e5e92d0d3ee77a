// Which of a host's several priors a frame's pose comes from.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "plumb/geometry/rigid3.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// What the search around one prior came to.
struct PriorOutcome {
  RefineStatus status = RefineStatus::kLowSupport;  // as if it were the only prior
  /// The best pose found, whatever the status; nullopt when there was nothing to compare.
  std::optional<Rigid3> cam_from_world;
  /// MatchEvidence of that pose on the lines that are visible from it, so that poses of different
  /// places can be compared [nats].
  double evidence_nats = 0.0;
  double runner_up_ratio = 0.0;  // among the poses that were found around the same prior
  /// Points that hold the pose where they decide and the lines do not; else 0.
  size_t num_deciding_points = 0;
};

struct PriorChoice {
  size_t prior = 0;
  RefineStatus status = RefineStatus::kLowSupport;
  /// That of the chosen pose, or the evidence of the best clearly different pose of another prior
  /// over its own if that is more.
  double runner_up_ratio = 0.0;
};

/// The refined pose with the most evidence; one that only points decide when there is none that
/// lines do. It is kAmbiguous when a clearly different pose of another prior has about as much
/// evidence (MaxRunnerUpRatio), whatever became of that one, or is held by
/// points. Where nothing was refined, the prior with the most evidence says why. Ties go to the
/// first prior.
/// @param outcomes  One a prior, at least one.
PriorChoice ChoosePrior(std::span<const PriorOutcome> outcomes);

}  // namespace plumb
