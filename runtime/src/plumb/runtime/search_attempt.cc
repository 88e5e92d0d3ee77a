// One attempt of the search method: from an uncertainty to a pose and a verdict.
#include <algorithm>
#include <numbers>

#include "plumb/base/stopwatch.h"
#include "plumb/runtime/search_method.h"

namespace plumb {
namespace {

// Three lines determine a pose, a fourth one can contradict it.
constexpr size_t kMinLines = 4, kMinSegments = 4;

// Aligned half way, poses nearer than this end at the same place.
constexpr double kSamePositionM = 0.01, kSameRotationRad = 0.005;

constexpr double kSearchGain = 1.03, kStreamGain = 1.0;

// A pose needs this share of the evidence that the key frames beside it have for theirs.
constexpr double kShareOfKeyFrames = 0.15;

// Beside points that decide, the search has only to contradict them: its best pose out of so many.
constexpr size_t kAlignedBesidePoints = 12;

bool IsSame(const Rigid3& a_from_world, const Rigid3& b_from_world) {
  const PoseDistance distance = DistanceBetween(a_from_world, b_from_world);
  return distance.position_m < kSamePositionM && distance.rotation_rad < kSameRotationRad;
}

SearchRegion RegionOf(const PosePrior& prior) {
  SearchRegion region{prior.cam_from_world, prior.rotation_sigma_rad, prior.position_sigma_m};
  if (prior.gravity) {
    region.down_in_camera = prior.gravity->down_in_camera.cast<float>();
    region.tilt_sigma_rad = prior.gravity->sigma_rad;
  }
  return region;
}

}  // namespace

SearchMethod::Attempt SearchMethod::Try(const Trial& trial, const Plan& plan) {
  const PosePrior& prior = plan.prior;
  const RefineInput& input = trial.input;
  Attempt attempt;
  attempt.best.alignment.cam_from_world = prior.cam_from_world;
  survivors_.clear();
  Stopwatch watch;
  selector_.SelectForSearch(input.camera, prior.cam_from_world, prior.rotation_sigma_rad,
                            &search_lines_);
  search_table_.Assign(search_lines_, prior.cam_from_world);
  stages_.index_ns += watch.Lap();
  if (search_lines_.size() < kMinLines || segments_.segments.size() < kMinSegments) return attempt;

  const std::span<const FoundPose> starts = FindStarts(trial, plan);
  search_ns_ += watch.Lap();
  const auto schedule = input.search ? FineSchedule() : StreamSchedule();
  const auto align_from = [&](const Rigid3& start) {
    watch.Lap();
    const std::vector<CandidateLine>& lines = fine_lines_.Near(input.camera, start);
    stages_.index_ns += watch.Lap();
    if (lines.size() < kMinLines) return;
    aligner_.Begin(input.camera, start, lines, segments_);
    // Half way it shows whether a start leads to an answer that is already there.
    const size_t half = schedule.size() / 2;
    const Rigid3 half_way =
        aligner_.Run(start, schedule.first(half), WeakFactor(prior)).cam_from_world;
    stages_.fine_ns += watch.Lap();
    for (const Survivor& other : survivors_) {
      if (IsSame(half_way, other.alignment.cam_from_world)) return;
    }
    Survivor& survivor = survivors_.emplace_back();
    survivor.alignment = aligner_.Run(half_way, schedule.subspan(half), WeakFactor(prior));
    stages_.fine_ns += watch.Lap();
    survivor.support = MeasureSupport(input.camera, survivor.alignment.cam_from_world);
    stages_.support_ns += watch.Lap();
  };
  for (const FoundPose& start : starts) {
    if (!survivors_.empty() && IsOutOfTime(try_deadline_, kStartsShare)) break;
    align_from(start.cam_from_world);
  }
  if (trial.points.num_inliers >= kMinSolvingPoints) align_from(trial.points.cam_from_world);
  // What earlier attempts have found, the rival with it.
  if (trial.attempt.has_pose) align_from(trial.attempt.best.alignment.cam_from_world);
  if (trial.attempt.runner_up) align_from(*trial.attempt.runner_up);
  if (survivors_.empty()) return attempt;
  attempt.has_pose = true;
  watch.Lap();
  Survivor& best = *std::max_element(
      survivors_.begin(), survivors_.end(),
      [](const Survivor& a, const Survivor& b) { return a.support.Value() < b.support.Value(); });
  best.fused_nats = best.nats = FusedEvidence(input.camera, best.alignment.cam_from_world);
  Judge(input, prior, best, &attempt);
  const bool is_open = attempt.status == RefineStatus::kLowSupport ||
                       (attempt.status == RefineStatus::kAmbiguous && best.IsWeak());
  if (plan.is_last && is_open && !IsOutOfTime(kLastStepsShare)) {
    const Survivor& other = AskKeyFrames(input, prior);
    if (other.is_by_key_frames) Judge(input, prior, other, &attempt);
  }
  stages_.support_ns += watch.Lap();
  return attempt;
}

void SearchMethod::Judge(const RefineInput& input, const PosePrior& prior, const Survivor& best,
                         Attempt* attempt) {
  attempt->best = best;
  const FineAlignment& found = best.alignment;
  attempt->evidence = {.refined = best.support,
                       .prior = MeasureSupport(input.camera, kept_),
                       .is_near_prior = IsPlausible(found.cam_from_world, input.prior),
                       .evidence_nats = best.nats,
                       .num_observed_directions = CountObservedDirections(
                           found.line_information / std::max(found.residual_scale, 1.0), prior)};
  FindRunnerUp(attempt);
  attempt->status = Decide(attempt->evidence,
                           {.min_map_support = options_.min_map_support,
                            .min_evidence_nats = EvidenceNeeded(found.cam_from_world, best.nats),
                            .max_runner_up_ratio = MaxRunnerUpRatio(best.fused_nats),
                            .min_gain = input.search ? kSearchGain : kStreamGain,
                            .needs_all_directions = input.search});
}

std::span<const FoundPose> SearchMethod::FindStarts(const Trial& trial, const Plan& plan) {
  const PosePrior& prior = plan.prior;
  const RefineInput& input = trial.input;
  if (!input.search) {
    only_prior_[0] = {prior.cam_from_world, 0.0};
    return only_prior_;
  }
  lines_to_find_.clear();
  for (const CandidateLine& line : search_lines_) {
    lines_to_find_.push_back({line.segment_in_world, line.weight});
  }
  if (!is_image_set_) {
    Stopwatch watch;
    pose_search_.SetImage(input.camera, segments_.segments);
    is_image_set_ = true;
    stages_.field_ns = watch.Lap();
  }
  PoseSearchOptions search{.num_hypotheses = plan.num_hypotheses,
                           .num_survivors = kMaxSurvivors,
                           .deadline = try_deadline_};
  if (plan.is_close) search.num_wide = 0;
  if (HoldsByPoints(input, trial.points)) {
    search.num_aligned = kAlignedBesidePoints;
    search.num_wide = 0;
    search.num_survivors = 1;
  }
  const std::span<const FoundPose> found = pose_search_.Search(
      RegionOf(prior), lines_to_find_, search, MixSeeds(options_.seed, input.seed));
  const PoseSearchStats& stats = pose_search_.stats();
  stages_.score_ns += stats.draw_ns + stats.score_ns;
  stages_.coarse_ns += stats.align_ns;
  stages_.num_hypotheses += stats.num_scored;
  stages_.out_of_time |= stats.out_of_time;
  return found;
}

PoseSupport SearchMethod::MeasureSupport(const Camera& camera, const Rigid3& cam_from_world) {
  ProjectTable(camera, cam_from_world, search_table_, kMinVisiblePx, &projected_);
  return support_meter_.Measure(projected_, segments_.table);
}

double SearchMethod::FusedEvidence(const Camera& camera, const Rigid3& cam_from_world) {
  ProjectCandidates(camera, cam_from_world, search_lines_, kMinVisiblePx, &projected_);
  return evidence_meter_.Measure(projected_, segments_.table).nats;
}

const SearchMethod::Survivor& SearchMethod::AskKeyFrames(const RefineInput& input,
                                                         const PosePrior& prior) {
  for (Survivor& survivor : survivors_) {
    survivor.fused_nats = survivor.nats =
        FusedEvidence(input.camera, survivor.alignment.cam_from_world);
    FineAlignment local = survivor.alignment;
    if (!last_steps_.AlignOnLocalLines(WeakFactor(prior), &local)) continue;
    ProjectCandidates(input.camera, local.cam_from_world, last_steps_.local_lines(), kMinVisiblePx,
                      &projected_);
    // The better of two measurements reaches by chance twice as often what one of them reaches.
    const double nats =
        evidence_meter_.Measure(projected_, segments_.table).nats - std::numbers::ln2;
    if (!(nats > survivor.nats)) continue;
    survivor.nats = nats;
    survivor.alignment = local;
    survivor.is_by_key_frames = true;  // its support stays that of the fused lines' own alignment
  }
  return *std::max_element(survivors_.begin(), survivors_.end(),
                           [](const Survivor& a, const Survivor& b) { return a.nats < b.nats; });
}

void SearchMethod::FindRunnerUp(Attempt* attempt) const {
  const Survivor& best = attempt->best;
  const auto value = [&best](const Survivor& survivor) {
    return best.is_by_key_frames ? survivor.nats : survivor.support.Value();
  };
  attempt->evidence.runner_up_ratio = 0.0;
  attempt->runner_up.reset();
  if (!(value(best) > 0.0)) return;
  for (const Survivor& other : survivors_) {
    const Rigid3& pose = other.alignment.cam_from_world;
    if (!IsClearlyDifferent(pose, best.alignment.cam_from_world)) continue;
    const double ratio = value(other) / value(best);
    if (attempt->runner_up && ratio <= attempt->evidence.runner_up_ratio) continue;
    attempt->evidence.runner_up_ratio = ratio;
    attempt->runner_up = pose;
  }
}

double SearchMethod::EvidenceNeeded(const Rigid3& cam_from_world, double nats) {
  const double by_chance = EvidenceToBeat(num_tried_);
  if (nats < by_chance || nats > kPlentyOfNats) return by_chance;
  return std::max(by_chance, kShareOfKeyFrames * expected_evidence_.LeastNear(cam_from_world));
}

}  // namespace plumb
