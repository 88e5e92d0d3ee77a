#include "plumb/runtime/stream_tracker.h"

#include <cassert>
#include <optional>
#include <utility>

namespace plumb {

StreamTracker::StreamTracker(PoseRefiner* refiner, const StreamOptions& options)
    : refiner_(refiner), options_(options) {
  assert(refiner != nullptr && options.Validate());
}

Status StreamTracker::Track(const RefineInput& input, RefineResult* out_result) {
  const Rigid3 tracker = input.prior.cam_from_world;
  const std::optional<PosePrior> local = PredictLocally(state_, options_, tracker);
  int64_t match_ns = 0, total_ns = 0;  // of a local refinement that was in vain
  searched_ = false;
  if (local) {
    RefineInput local_input = input;
    local_input.prior = *local;
    local_input.prior.gravity = input.prior.gravity;
    local_input.more_priors = {};
    local_input.search = false;
    if (const Status status = refiner_->Refine(local_input, out_result); !status) return status;
    match_ns = out_result->match_and_refine_ns;
    total_ns = out_result->total_ns;
  }
  if (!local || IsLost(state_, options_, *out_result)) {
    if (const Status status = Search(input, out_result); !status) return status;
    out_result->match_and_refine_ns += match_ns;
    out_result->total_ns += total_ns;
  }
  const Rigid3 predicted = local ? local->cam_from_world : tracker;
  if (!IsSuccess(out_result->status)) out_result->cam_from_world = predicted;
  Advance(options_, tracker, predicted, *out_result, &state_);
  return Ok();
}

Status StreamTracker::Search(const RefineInput& input, RefineResult* out_result) {
  searched_ = true;
  RefineInput search_input = input;
  search_input.search = true;
  search_input.prior = SearchPrior(state_, input.prior);
  if (const Status status = refiner_->Refine(search_input, out_result); !status) return status;
  if (!state_.last || !IsLost(state_, options_, *out_result)) return Ok();

  search_input.prior = input.prior;
  search_input.more_priors = {};    // tried already
  search_input.seed = ~input.seed;  // other draws
  if (const Status status = refiner_->Refine(search_input, &second_); !status) return status;
  const int64_t search_ns = out_result->search_ns + second_.search_ns;
  const int64_t match_ns = out_result->match_and_refine_ns + second_.match_and_refine_ns;
  const int64_t total_ns = out_result->total_ns + second_.total_ns;
  if (IsBetter(second_, *out_result)) std::swap(*out_result, second_);
  out_result->search_ns = search_ns;
  out_result->match_and_refine_ns = match_ns;
  out_result->total_ns = total_ns;
  return Ok();
}

}  // namespace plumb
