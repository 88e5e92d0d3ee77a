#include "plumb/runtime/pose_refiner.h"

#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "plumb/refine/uncertainty.h"
#include "plumb/runtime/gravity.h"
#include "plumb/runtime/paper_method.h"
#include "plumb/runtime/refine_input_check.h"
#include "plumb/runtime/search_method.h"

namespace plumb {

std::string_view ToString(RefineStatus status) {
  switch (status) {
    case RefineStatus::kRefined:
      return "REFINED";
    case RefineStatus::kKeptPrior:
      return "KEPT_PRIOR";
    case RefineStatus::kAmbiguous:
      return "AMBIGUOUS";
    case RefineStatus::kDegenerate:
      return "DEGENERATE";
    case RefineStatus::kLowSupport:
      return "LOW_SUPPORT";
  }
  return "UNKNOWN";
}

RefineStages& RefineStages::operator+=(const RefineStages& other) {
  for (int64_t RefineStages::*stage :
       {&RefineStages::index_ns, &RefineStages::field_ns, &RefineStages::score_ns,
        &RefineStages::coarse_ns, &RefineStages::fine_ns, &RefineStages::support_ns,
        &RefineStages::local_ns, &RefineStages::points_ns, &RefineStages::joint_ns,
        &RefineStages::covariance_ns, &RefineStages::report_ns}) {
    this->*stage += other.*stage;
  }
  num_hypotheses += other.num_hypotheses;
  out_of_time |= other.out_of_time;
  return *this;
}

Status PoseRefinerOptions::Validate() const {
  if (num_hypotheses && (*num_hypotheses < 1 || *num_hypotheses > 2048)) {
    return Error{ErrorCode::kInvalidArgument,
                 "num_hypotheses " + std::to_string(*num_hypotheses) + " is not in 1..2048"};
  }
  if (!(min_map_support > 0.0 && min_map_support < 1.0)) {
    return Error{ErrorCode::kInvalidArgument,
                 "min_map_support " + std::to_string(min_map_support) + " is not in (0, 1)"};
  }
  if (time_budget_ns < 0) {
    return Error{ErrorCode::kInvalidArgument,
                 "time_budget_ns " + std::to_string(time_budget_ns) + " is negative"};
  }
  if (time_budget_ns > 0 && method == RefineMethod::kPaper) {
    return Error{ErrorCode::kInvalidArgument,
                 "time_budget_ns " + std::to_string(time_budget_ns) +
                     ": the paper's method leaves nothing out, it takes no budget"};
  }
  return Ok();
}

struct PoseRefiner::Impl {
  PoseRefinerOptions options;
  std::optional<SearchMethod> search;
  std::optional<PaperMethod> paper;
  std::vector<PosePrior> more_priors;  // of a frame, with gravity
};

PoseRefiner::PoseRefiner(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PoseRefiner::~PoseRefiner() = default;

const PoseRefinerOptions& PoseRefiner::options() const { return impl_->options; }

Result<std::unique_ptr<PoseRefiner>> PoseRefiner::Create(const MapIndex& index,
                                                         const PoseRefinerOptions& options) {
  if (Status status = options.Validate(); !status) return status.error();
  auto impl = std::make_unique<Impl>();
  impl->options = options;
  if (options.method == RefineMethod::kPaper) {
    impl->paper.emplace(index, options);
  } else {
    impl->search.emplace(index, options);
  }
  return std::unique_ptr<PoseRefiner>(new PoseRefiner(std::move(impl)));
}

Status PoseRefiner::Refine(const RefineInput& input, RefineResult* out_result) {
  if (Status status = CheckRefineInput(input); !status) return status;
  if (impl_->paper && !input.more_priors.empty()) {
    return Error{ErrorCode::kInvalidArgument,
                 "more_priors has " + std::to_string(input.more_priors.size()) +
                     " entries, the paper's method takes one prior only"};
  }
  const auto start = std::chrono::steady_clock::now();
  // Starts from the answer "the prior is kept"; the matches keep their capacity.
  std::vector<LineMatch> matches = std::move(out_result->matches);
  matches.clear();
  *out_result = RefineResult{};
  out_result->matches = std::move(matches);
  out_result->cam_from_world = input.prior.cam_from_world;
  out_result->covariance =
      PriorCovariance(input.prior.rotation_sigma_rad, input.prior.position_sigma_m);
  RefineInput fused = input;
  fused.prior = FuseGravity(input.prior);
  impl_->more_priors.clear();
  for (const PosePrior& prior : input.more_priors) {
    impl_->more_priors.push_back(FuseGravity(prior));
  }
  fused.more_priors = impl_->more_priors;
  if (impl_->search) {
    impl_->search->Refine(fused, input.prior.cam_from_world, out_result);
  } else {
    impl_->paper->Refine(fused, input.prior.cam_from_world, out_result);
  }
  out_result->total_ns =
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now() - start)
          .count();
  return Ok();
}

}  // namespace plumb
