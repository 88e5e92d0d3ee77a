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
  const Deadline deadline =
      input.deadline ? *input.deadline : Deadline(refiner_->options().time_budget_ns);
  const std::optional<PosePrior> local = PredictLocally(state_, options_, input.prior);
  spent_ = {};
  searched_ = false;
  if (local) {
    RefineInput local_input = input;
    local_input.prior = *local;
    local_input.prior.gravity = input.prior.gravity;
    local_input.more_priors = {};
    local_input.search = false;
    local_input.deadline = deadline;
    if (const Status status = Refine(local_input, out_result); !status) return status;
  }
  if (!local || IsLost(state_, options_, *out_result)) {
    if (const Status status = Search(input, deadline, out_result); !status) return status;
  }
  out_result->search_ns = spent_.search_ns;
  out_result->match_and_refine_ns = spent_.match_and_refine_ns;
  out_result->total_ns = spent_.total_ns;
  out_result->stages = spent_.stages;
  const Rigid3 predicted = local ? local->cam_from_world : input.prior.cam_from_world;
  if (!IsSuccess(out_result->status)) out_result->cam_from_world = predicted;
  Advance(options_, input.prior.cam_from_world, predicted, *out_result, &state_);
  return Ok();
}

Status StreamTracker::Refine(const RefineInput& input, RefineResult* out_result) {
  if (const Status status = refiner_->Refine(input, out_result); !status) return status;
  spent_.search_ns += out_result->search_ns;
  spent_.match_and_refine_ns += out_result->match_and_refine_ns;
  spent_.total_ns += out_result->total_ns;
  spent_.stages += out_result->stages;
  return Ok();
}

Status StreamTracker::Search(const RefineInput& input, const Deadline& deadline,
                             RefineResult* out_result) {
  searched_ = true;
  RefineInput search_input = input;
  search_input.search = true;
  search_input.prior = SearchPrior(state_, input.prior);
  search_input.deadline = deadline.Part(1.0);
  if (const Status status = Refine(search_input, out_result); !status) return status;
  if (!state_.last || !IsLost(state_, options_, *out_result)) return Ok();
  if (deadline.HasPassed()) {
    spent_.stages.out_of_time = true;
    return Ok();
  }
  search_input.prior = input.prior;
  search_input.more_priors = {};    // tried already
  search_input.seed = ~input.seed;  // other draws
  search_input.deadline = deadline.Part(1.0);
  if (const Status status = Refine(search_input, &second_); !status) return status;
  if (!IsBetter(second_, *out_result)) return Ok();
  std::swap(*out_result, second_);
  // The tracker's pose is kept by no one.
  if (!IsSuccess(out_result->status)) out_result->matches.clear();
  return Ok();
}

}  // namespace plumb
