#include "plumb/runtime/paper_method.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "plumb/geometry/line_projection.h"
#include "plumb/refine/uncertainty.h"
#include "plumb/runtime/acceptance_gate.h"
#include "plumb/runtime/covariance_factor.h"
#include "plumb/runtime/gravity.h"

namespace plumb {
namespace {

constexpr uint32_t kNumKeyFrames = 5;
constexpr double kMinOverlap = 0.25;
constexpr double kMinGain = 1.03;
constexpr double kVariancePx2 = 0.7 * 0.7;
constexpr double kRobust = 2.0;
constexpr size_t kMaxSegments = 400;

int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

PaperMethod::PaperMethod(const MapIndex& index, const PoseRefinerOptions& options)
    : index_(index), options_(options), selector_(index) {
  const LineMap& map = index.map();
  for (const MapLine& line : map.lines) lines_.push_back(line.segment_in_world);
  for (const KeyFrame& key_frame : map.key_frames) {
    View& view = views_.emplace_back();
    for (const LiftedSegment& lifted : key_frame.segments) {
      if (!lifted.line) continue;
      view.segments.push_back(lifted.segment_px);
      view.lines.push_back(*lifted.line);
    }
  }
}

void PaperMethod::CollectCandidates(const RefineInput& input) {
  const LineMap& map = index_.map();
  candidates_.clear();
  index_.NearestKeyFrames(input.prior.cam_from_world, kNumKeyFrames, &key_frames_);
  for (const uint32_t k : key_frames_) {
    AppendEpipolarCandidates(input.camera, input.prior.cam_from_world, segments_.segments,
                             {.camera = map.key_frames[k].camera,
                              .cam_from_world = map.key_frames[k].cam_from_world,
                              .segments = views_[k].segments,
                              .lines = views_[k].lines},
                             kMinOverlap, &candidates_);
  }
  std::sort(candidates_.begin(), candidates_.end());
  candidates_.erase(std::unique(candidates_.begin(), candidates_.end()), candidates_.end());
}

PoseSupport PaperMethod::MeasureSupport(const Camera& camera, const Rigid3& cam_from_world) {
  ProjectCandidates(camera, cam_from_world, search_lines_, kMinVisiblePx, &projected_);
  return support_meter_.Measure(projected_, segments_.table);
}

void PaperMethod::Refine(const RefineInput& input, const Rigid3& kept, RefineResult* result) {
  const int64_t start_ns = NowNs();
  const Rigid3& prior = input.prior.cam_from_world;
  segments_.Assign(input.segments, kMaxSegments);
  selector_.SelectForSearch(input.camera, prior, input.prior.rotation_sigma_rad, &search_lines_);
  CollectCandidates(input);
  Rigid3 refined = prior;
  points_.clear();
  for (const PointMatch& match : input.points) {
    points_.push_back({match.pixel, match.point_in_world, match.deviation_in_world});
  }
  solver_.Solve(input.camera, segments_.segments, lines_, candidates_, points_,
                options_.residual.value_or(LineResidual::kMidpointAngle), &refined);

  observations_.clear();
  for (const LineAssignment& match : solver_.assignments()) {
    observations_.push_back({.line_in_world = lines_[match.line],
                             .part_px = segments_.segments[match.segment],
                             .weight = 1.0,
                             .variance_px2 = kVariancePx2});
  }
  const LineEquations terms = AccumulateLines(input.camera, refined, observations_, kRobust);
  const Matrix6d prior_information = CovarianceOf(input.prior).inverse();
  const PoseSupport prior_support = MeasureSupport(input.camera, kept);
  const GateEvidence evidence{
      .refined = MeasureSupport(input.camera, refined),  // last: projects for the evidence
      .prior = prior_support,
      .is_near_prior = IsPlausible(refined, input.prior),
      .evidence_nats = evidence_meter_.Measure(projected_, segments_.table).nats,
      .num_observed_directions = CountObservedDirections(
          terms.equations.information / std::max(terms.residual_scale, 1.0), input.prior)};
  result->status = Decide(evidence, {.min_map_support = options_.min_map_support,
                                     .min_evidence_nats = EvidenceToBeat(1),
                                     .min_gain = kMinGain});
  result->map_support = evidence.refined.map_share;
  result->evidence_nats = evidence.evidence_nats;
  result->num_observed_directions = evidence.num_observed_directions;
  if (result->status == RefineStatus::kRefined) {
    result->cam_from_world = refined;
    const double factor = CovarianceFactorAt(index_, refined, &factor_key_frames_);
    result->covariance = PoseCovariance(terms.equations.information, terms.residual_scale, factor,
                                        prior_information);
    result->num_points_used = static_cast<uint32_t>(points_.size());
  }
  for (const LineAssignment& match : solver_.assignments()) {
    const Segment2& segment = segments_.segments[match.segment];
    const Segment3& line = lines_[match.line];
    const auto image = ProjectLine(
        input.camera, {result->cam_from_world * line.start, result->cam_from_world * line.end});
    if (!image) continue;
    const double a = image->SignedDistance(segment.start), b = image->SignedDistance(segment.end);
    result->matches.push_back({.segment = segments_.source[match.segment],
                               .line = match.line,
                               .distance_px = std::sqrt(0.5 * (a * a + b * b))});
  }
  result->match_and_refine_ns = NowNs() - start_ns;
}

}  // namespace plumb
