#include "plumb/runtime/search_method.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plumb/base/stopwatch.h"
#include "plumb/refine/uncertainty.h"
#include "plumb/runtime/covariance_factor.h"
#include "plumb/runtime/gravity.h"

namespace plumb {
namespace {

constexpr size_t kMaxSegments = 250;

// The prior is a weak factor of the alignment: it decides only what the lines leave open.
constexpr double kPriorFactorScale = 2.0;

// A pose that so many points hold is an answer.
constexpr size_t kMinDecidingPoints = 40;

// Of the search; in between by the larger of both sizes.
constexpr uint32_t kFewHypotheses = 500, kManyHypotheses = 1500;
constexpr double kFewPositionM = 0.10, kFewRotationRad = 0.035;

// A second attempt looks twice as far. A prior that was found good needs none.
constexpr double kWideningFactor = 2.0;
constexpr uint32_t kMaxHypotheses = 2048;

// A pose with a smaller share of what the key frames beside it have, or of plenty where none are,
// is looked for again close to where it was found; also one that was refused in spite of some
// evidence.
constexpr double kShareOfSure = 0.6;
constexpr double kClosePositionM = 0.12, kCloseRotationRad = 0.05;
constexpr uint32_t kCloseHypotheses = 300;

// How far rivals of a weak pose are looked for: repeated structure does not keep to the prior.
constexpr double kRivalFactor = 3.0;

constexpr double kMinScale = 0.02;  // of residuals: perfect input must not divide by zero

PosePrior Widened(PosePrior prior, double factor) {
  prior.position_sigma_m *= factor;
  prior.rotation_sigma_rad *= factor;
  return prior;
}

Matrix6d PriorInformation(const PosePrior& prior) { return CovarianceOf(prior).inverse(); }

}  // namespace

SearchMethod::SearchMethod(const MapIndex& index, const PoseRefinerOptions& options)
    : index_(index),
      options_(options),
      selector_(index),
      fine_lines_(index),
      last_steps_(index, &fine_lines_),
      expected_evidence_(index) {}

void SearchMethod::Refine(const RefineInput& input, const Rigid3& kept, RefineResult* result) {
  Stopwatch whole, watch;
  stages_ = {};
  search_ns_ = 0;
  deadline_ = input.deadline ? *input.deadline : Deadline(options_.time_budget_ns);
  fine_lines_.Forget();
  is_image_set_ = false;
  kept_ = kept;
  segments_.Assign(input.segments, kMaxSegments);
  AcceptPoints(input);
  last_steps_.Begin({input.camera, &segments_, observed_points_, &all_points_});
  BeginTrials(input);
  WidenTrials();
  LookCloser();
  const PriorChoice choice = Choose(input.camera);
  Trial& trial = trials_[choice.prior];
  const Attempt& attempt = trial.attempt;
  result->status = choice.status;
  result->runner_up_ratio = choice.runner_up_ratio;
  if (input.search && choice.status == RefineStatus::kRefined &&
      attempt.status == RefineStatus::kRefined && attempt.best.IsWeak() &&
      !HoldsByPoints(trial.input, trial.points)) {
    if (IsOutOfTime(kWideningShare)) {
      result->status = RefineStatus::kAmbiguous;  // nobody has looked for rivals
    } else {
      const bool is_another_pose = LookFarther(&trial);
      result->status = attempt.status;
      result->runner_up_ratio = std::max(is_another_pose ? 0.0 : result->runner_up_ratio,
                                         attempt.evidence.runner_up_ratio);
    }
  }
  result->map_support = attempt.evidence.refined.map_share;
  result->evidence_nats = attempt.evidence.evidence_nats;
  result->num_observed_directions = attempt.evidence.num_observed_directions;
  if (result->status == RefineStatus::kRefined) {
    result->prior_index = static_cast<uint32_t>(choice.prior);
    FineAlignment start = attempt.best.alignment;
    if (attempt.status != RefineStatus::kRefined) {
      // The lines do not decide, the points do.
      start = FineAlignment{};
      start.cam_from_world = trial.points.cam_from_world;
    }
    Finish(trial.prior, start, result);
  }
  watch.Lap();
  last_steps_.AppendMatches(result->cam_from_world, &result->matches);
  stages_.report_ns = watch.Lap();
  result->search_ns = search_ns_;
  result->match_and_refine_ns = whole.Lap() - search_ns_;
  result->stages = stages_;
}

void SearchMethod::BeginTrials(const RefineInput& input) {
  trials_.clear();
  const size_t num_priors = 1 + input.more_priors.size();
  num_tried_ = 0;
  const auto count = [&](const PosePrior& prior) {
    num_tried_ += input.search ? CountDistinctPoses(prior, NumHypotheses(prior)) : 1;
  };
  count(input.prior);
  for (const PosePrior& prior : input.more_priors) count(prior);
  for (size_t k = 0; k < num_priors; ++k) {
    if (k > 0 && IsOutOfTime(kStartsShare)) return;
    AddTrial(input, k);
    Trial& trial = trials_.back();
    Stopwatch watch;
    trial.points = SolvePoints(trial.input);
    stages_.points_ns += watch.Lap();
    try_deadline_ = deadline_.Part(1.0 / static_cast<double>(num_priors - k));
    trial.attempt = Try(trial, {.prior = trial.prior,
                                .num_hypotheses = NumHypotheses(trial.prior),
                                .is_last = !input.search});
  }
}

uint32_t SearchMethod::NumHypotheses(const PosePrior& prior) const {
  if (options_.num_hypotheses) return *options_.num_hypotheses;
  const double size =
      std::max(prior.position_sigma_m / kFewPositionM, prior.rotation_sigma_rad / kFewRotationRad);
  return static_cast<uint32_t>(
      std::clamp<double>(kFewHypotheses * size, kFewHypotheses, kManyHypotheses));
}

void SearchMethod::AddTrial(const RefineInput& input, size_t prior) {
  Trial& trial = trials_.emplace_back();
  trial.input = input;
  trial.input.more_priors = {};
  if (prior > 0) {
    trial.input.prior = input.more_priors[prior - 1];
    trial.input.seed = MixSeeds(input.seed, prior);
  }
  trial.prior = trial.input.prior;
}

bool SearchMethod::HasSucceeded(const Trial& trial) const {
  return trial.attempt.status == RefineStatus::kRefined ||
         HoldsByPoints(trial.input, trial.points) ||
         (trial.attempt.status == RefineStatus::kKeptPrior && !MayWiden(trial.attempt));
}

bool SearchMethod::HasAnySucceeded() const {
  return std::any_of(trials_.begin(), trials_.end(),
                     [this](const Trial& trial) { return HasSucceeded(trial); });
}

bool SearchMethod::ShouldWiden(const Trial& trial) const {
  return trial.input.search && MayWiden(trial.attempt);
}

void SearchMethod::WidenTrials() {
  if (HasAnySucceeded()) return;
  size_t num_left = 0;
  const auto widened = [](const Trial& trial) {
    return Widened(trial.input.prior, kWideningFactor);
  };
  const auto num_hypotheses = [this](const Trial& trial) {
    return std::min(kMaxHypotheses, 2 * NumHypotheses(trial.input.prior));
  };
  for (const Trial& trial : trials_) {
    if (!ShouldWiden(trial)) continue;
    num_tried_ += CountDistinctPoses(widened(trial), num_hypotheses(trial));
    ++num_left;
  }
  for (Trial& trial : trials_) {
    if (!ShouldWiden(trial)) continue;
    if (IsOutOfTime(kWideningShare)) return;
    const PosePrior wide = widened(trial);
    try_deadline_ = deadline_.Part(1.0 / static_cast<double>(num_left));
    --num_left;
    const Attempt second = Try(trial, {.prior = wide, .num_hypotheses = num_hypotheses(trial)});
    const bool is_refined = second.status == RefineStatus::kRefined;
    if (is_refined) trial.prior = wide;
    if (is_refined || second.best.nats > trial.attempt.best.nats) trial.attempt = second;
  }
}

bool SearchMethod::IsDoubtful(const Attempt& attempt) {
  if (!attempt.has_pose) return false;
  const double nats = attempt.best.nats;
  const bool is_refined = attempt.status == RefineStatus::kRefined;
  const bool is_open =
      attempt.status == RefineStatus::kLowSupport || attempt.status == RefineStatus::kAmbiguous;
  if (!is_refined && !(is_open && nats > 0.0)) return false;
  if (nats > kPlentyOfNats) return false;
  const double sure = expected_evidence_.LeastNear(attempt.best.alignment.cam_from_world);
  return nats < std::max(kWeakNats, kShareOfSure * (sure > 0.0 ? sure : kPlentyOfNats));
}

void SearchMethod::LookCloser() {
  const bool has_any_succeeded = HasAnySucceeded();
  for (Trial& trial : trials_) {
    if (!trial.input.search || HoldsByPoints(trial.input, trial.points)) continue;
    if (has_any_succeeded && trial.attempt.status != RefineStatus::kRefined) continue;
    if (!IsDoubtful(trial.attempt)) continue;
    if (IsOutOfTime(kWideningShare)) return;
    PosePrior close = trial.prior;
    close.cam_from_world = trial.attempt.best.alignment.cam_from_world;
    close.position_sigma_m = std::min(close.position_sigma_m, kClosePositionM);
    close.rotation_sigma_rad = std::min(close.rotation_sigma_rad, kCloseRotationRad);
    if (close.gravity) {  // never less certain of the tilt than without it
      close.gravity->sigma_rad =
          std::min(close.gravity->sigma_rad, close.rotation_sigma_rad / std::numbers::sqrt3);
    }
    const uint32_t num_hypotheses = std::min(NumHypotheses(close), kCloseHypotheses);
    num_tried_ += CountDistinctPoses(close, num_hypotheses);
    try_deadline_ = deadline_.Part(1.0);
    const Attempt second =
        Try(trial,
            {.prior = close, .num_hypotheses = num_hypotheses, .is_close = true, .is_last = true});
    if (second.status == RefineStatus::kRefined &&
        (trial.attempt.status != RefineStatus::kRefined ||
         second.best.nats > trial.attempt.best.nats)) {
      trial.attempt = second;
    }
  }
}

PriorChoice SearchMethod::Choose(const Camera& camera) {
  Stopwatch watch;
  outcomes_.clear();
  for (const Trial& trial : trials_) {
    const Survivor& best = trial.attempt.best;
    PriorOutcome& outcome = outcomes_.emplace_back();
    outcome.status = trial.attempt.status;
    outcome.runner_up_ratio = trial.attempt.evidence.runner_up_ratio;
    outcome.evidence_nats = trial.attempt.evidence.evidence_nats;
    if (trial.attempt.has_pose) {
      outcome.cam_from_world = best.alignment.cam_from_world;
      if (trials_.size() > 1) {
        selector_.SelectForSearch(camera, *outcome.cam_from_world, 0.0, &search_lines_);
        const double nats = FusedEvidence(camera, *outcome.cam_from_world);
        outcome.evidence_nats = best.is_by_key_frames ? std::max(nats, best.nats) : nats;
      }
    }
    if (outcome.status != RefineStatus::kRefined && HoldsByPoints(trial.input, trial.points)) {
      outcome.status = RefineStatus::kRefined;
      outcome.cam_from_world = trial.points.cam_from_world;
      outcome.num_deciding_points = trial.points.num_inliers;
    }
  }
  const PriorChoice choice = ChoosePrior(outcomes_);
  stages_.support_ns += watch.Lap();
  return choice;
}

void SearchMethod::Finish(const PosePrior& prior, FineAlignment alignment, RefineResult* result) {
  Stopwatch watch;
  if (options_.residual == LineResidual::kMidpointAngle) {
    if (!IsOutOfTime(kLastStepsShare)) last_steps_.SolveOneToOne(&alignment);
  } else {
    last_steps_.ForgetLocalLines();
    if (!IsOutOfTime(kLastStepsShare)) {
      last_steps_.AlignOnLocalLines(WeakFactor(prior), &alignment);
    }
    stages_.local_ns = watch.Lap();
    if (!IsOutOfTime()) last_steps_.AlignWithPoints(WeakFactor(prior), &alignment);
  }
  stages_.joint_ns = watch.Lap();
  // Both families in units of the lines' own residuals, which the covariance divides out again.
  const Matrix6d information =
      alignment.line_information + alignment.residual_scale * alignment.point_information;
  const Matrix6d prior_information = PriorInformation(prior);
  const double factor = CovarianceFactorAt(index_, alignment.cam_from_world, &key_frames_);
  result->cam_from_world = alignment.cam_from_world;
  result->covariance =
      PoseCovariance(information, alignment.residual_scale, factor, prior_information);
  result->num_observed_directions =
      Observe(information / std::max(alignment.residual_scale, kMinScale), prior_information)
          .num_observed;
  result->num_points_used = static_cast<uint32_t>(alignment.num_points);
  stages_.covariance_ns = watch.Lap();
}

void SearchMethod::AcceptPoints(const RefineInput& input) {
  observed_points_.clear();
  for (const PointMatch& match : input.points) {
    observed_points_.push_back({match.pixel, match.point_in_world, match.deviation_in_world});
  }
  all_points_.Assign(observed_points_, input.prior.cam_from_world);
}

PointPose SearchMethod::SolvePoints(const RefineInput& input) {
  if (all_points_.size() < kMinSolvingPoints) return {};
  return point_solver_.Solve(input.camera, WeakFactor(input.prior), all_points_);
}

bool SearchMethod::HoldsByPoints(const RefineInput& input, const PointPose& points) const {
  return points.num_inliers >= kMinDecidingPoints && 2 * points.num_inliers >= all_points_.size() &&
         IsPlausible(points.cam_from_world, input.prior);
}

bool SearchMethod::LookFarther(Trial* trial) {
  const PosePrior wide = Widened(trial->prior, kRivalFactor);
  try_deadline_ = deadline_.Part(1.0);
  num_tried_ += CountDistinctPoses(wide, kMaxHypotheses);
  const Attempt second = Try(*trial, {.prior = wide, .num_hypotheses = kMaxHypotheses});
  Attempt& attempt = trial->attempt;
  if (second.status == RefineStatus::kRefined && second.best.nats > attempt.best.nats) {
    attempt = second;
    trial->prior = wide;
    return true;
  }
  if (attempt.best.is_by_key_frames) AskKeyFrames(trial->input, wide);
  // On the lines that the wide prior sees, as the supports of the survivors.
  attempt.best.support = MeasureSupport(trial->input.camera, attempt.best.alignment.cam_from_world);
  FindRunnerUp(&attempt);
  if (attempt.evidence.runner_up_ratio > MaxRunnerUpRatio(attempt.best.fused_nats)) {
    attempt.status = RefineStatus::kAmbiguous;
  }
  return false;
}

bool SearchMethod::MayWiden(const Attempt& attempt) const {
  switch (attempt.status) {
    case RefineStatus::kLowSupport:
    case RefineStatus::kAmbiguous:
      return true;
    case RefineStatus::kKeptPrior:  // A prior that the search came back to is trusted.
      return IsClearlyDifferent(attempt.best.alignment.cam_from_world, kept_);
    case RefineStatus::kRefined:
    case RefineStatus::kDegenerate:
      return false;
  }
  return false;
}

PosePriorFactor SearchMethod::WeakFactor(const PosePrior& prior) {
  PosePriorFactor factor{prior.cam_from_world, kPriorFactorScale * prior.rotation_sigma_rad,
                         kPriorFactorScale * prior.position_sigma_m};
  if (prior.gravity) {
    factor.tilt =
        TiltPrior{prior.gravity->down_in_camera, kPriorFactorScale * prior.gravity->sigma_rad};
  }
  return factor;
}

bool SearchMethod::IsOutOfTime(const Deadline& deadline, double share) {
  if (!deadline.HasPassed(share)) return false;
  stages_.out_of_time = true;
  return true;
}

}  // namespace plumb
