#include "plumb/runtime/stream_tracker.h"

#include <cassert>
#include <optional>

namespace plumb {

StreamTracker::StreamTracker(PoseRefiner* refiner, const StreamOptions& options)
    : refiner_(refiner), options_(options) {
  assert(refiner != nullptr && options.Validate());
}

Status StreamTracker::Track(const RefineInput& input, RefineResult* out_result) {
  const Rigid3 tracker = input.prior.cam_from_world;
  const std::optional<PosePrior> local = PredictLocally(state_, options_, tracker);
  int64_t local_match_ns = 0, local_total_ns = 0;
  searched_ = false;
  if (local) {
    RefineInput local_input = input;
    local_input.prior = *local;
    local_input.search = false;
    if (const Status status = refiner_->Refine(local_input, out_result); !status) return status;
    local_match_ns = out_result->match_and_refine_ns;
    local_total_ns = out_result->total_ns;
  }
  if (!local || IsLost(state_, options_, *out_result)) {
    searched_ = true;
    RefineInput search_input = input;
    search_input.prior = SearchPrior(state_, input.prior);
    search_input.search = true;
    if (const Status status = refiner_->Refine(search_input, out_result); !status) return status;
    out_result->match_and_refine_ns += local_match_ns;
    out_result->total_ns += local_total_ns;
  }
  const Rigid3 predicted = local ? local->cam_from_world : tracker;
  if (!IsSuccess(out_result->status)) out_result->cam_from_world = predicted;
  Advance(options_, tracker, predicted, *out_result, &state_);
  return Ok();
}

}  // namespace plumb
