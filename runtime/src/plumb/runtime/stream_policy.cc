#include "plumb/runtime/stream_policy.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "plumb/runtime/refine_input_check.h"

namespace plumb {
namespace {

Rigid3 PredictedPose(const StreamState::Anchor& last, const Rigid3& tracker_cam_from_world) {
  return tracker_cam_from_world * last.tracker_cam_from_world.Inverse() * last.cam_from_world;
}

}  // namespace

Status StreamOptions::Validate() const {
  const auto invalid = [](const char* name, double value, const char* range) -> Status {
    return Error{ErrorCode::kInvalidArgument, std::string("StreamOptions: ") + name + " " +
                                                  std::to_string(value) + " is outside " + range};
  };
  if (!(position_sigma_m >= kMinSigma && position_sigma_m <= kMaxPositionSigmaM)) {
    return invalid("position_sigma_m", position_sigma_m, "[1e-9, 1000]");
  }
  if (!(rotation_sigma_rad >= kMinSigma && rotation_sigma_rad <= kMaxRotationSigmaRad)) {
    return invalid("rotation_sigma_rad", rotation_sigma_rad, "[1e-9, 3.2]");
  }
  if (!(lost_support_share >= 0.0 && lost_support_share < 1.0)) {
    return invalid("lost_support_share", lost_support_share, "[0, 1)");
  }
  if (!(support_memory >= 0.0 && support_memory < 1.0)) {
    return invalid("support_memory", support_memory, "[0, 1)");
  }
  return Ok();
}

std::optional<PosePrior> PredictLocally(const StreamState& state, const StreamOptions& options,
                                        const PosePrior& tracker) {
  if (!state.last) return std::nullopt;
  const double growth = std::sqrt(1.0 + state.frames_without_success);
  // A stream may be dark for hours.
  const auto grown = [growth](double sigma, double of_tracker) {
    return std::min(growth * sigma, std::max(sigma, of_tracker));
  };
  return PosePrior{PredictedPose(*state.last, tracker.cam_from_world),
                   grown(options.position_sigma_m, tracker.position_sigma_m),
                   grown(options.rotation_sigma_rad, tracker.rotation_sigma_rad)};
}

PosePrior SearchPrior(const StreamState& state, const PosePrior& tracker) {
  PosePrior prior = tracker;
  if (state.last) prior.cam_from_world = PredictedPose(*state.last, tracker.cam_from_world);
  return prior;
}

bool IsLost(const StreamState& state, const StreamOptions& options, const RefineResult& result) {
  return !IsSuccess(result.status) ||
         result.map_support < options.lost_support_share * state.mean_support;
}

bool IsBetter(const RefineResult& a, const RefineResult& b) {
  if (IsSuccess(a.status) != IsSuccess(b.status)) return IsSuccess(a.status);
  return a.map_support > b.map_support;
}

void Advance(const StreamOptions& options, const Rigid3& tracker_cam_from_world,
             const Rigid3& predicted, const RefineResult& result, StreamState* state) {
  const bool success = IsSuccess(result.status);
  state->last =
      StreamState::Anchor{success ? result.cam_from_world : predicted, tracker_cam_from_world};
  state->frames_without_success = success ? 0 : state->frames_without_success + 1;
  if (result.status == RefineStatus::kRefined) {
    const double memory = state->mean_support > 0.0 ? options.support_memory : 0.0;
    state->mean_support = memory * state->mean_support + (1.0 - memory) * result.map_support;
  }
}

}  // namespace plumb
