#include "plumb/runtime/fine_alignment.h"

#include <algorithm>
#include <numeric>

namespace plumb {
namespace {

constexpr AlignmentStep kFine[] = {
    {8.0, 0.12, 2.0}, {6.0, 0.10, 2.0}, {5.0, 0.09, 2.0}, {4.0, 0.08, 2.0}, {3.0, 0.06, 2.0},
    {2.0, 0.05, 2.0}, {2.0, 0.05, 2.0}, {1.5, 0.04, 1.5}, {1.0, 0.04, 1.0}, {1.0, 0.04, 1.0}};
constexpr AlignmentStep kStream[] = {
    {8.0, 0.12, 2.0}, {5.0, 0.09, 2.0}, {3.0, 0.06, 2.0}, {2.0, 0.05, 2.0}, {1.0, 0.04, 1.0}};
constexpr AlignmentStep kJoint[] = {{5.0, 0.09, 2.0}, {3.0, 0.06, 2.0}, {2.0, 0.05, 2.0},
                                    {2.0, 0.05, 2.0}, {1.5, 0.04, 1.5}, {1.0, 0.04, 1.0},
                                    {1.0, 0.04, 1.0}, {1.0, 0.04, 1.0}, {1.0, 0.04, 1.0}};

constexpr double kMinVisiblePx = 10.0;
constexpr double kPixelSigma = 0.7;
constexpr double kOverlapCapPx = 120.0, kOverlapUnitPx = 30.0;
constexpr size_t kMinPairs = 4;
constexpr double kMaxRotationStep = 0.1;
constexpr double kMinResidualScale = 0.02;

}  // namespace

std::span<const AlignmentStep> FineSchedule() { return kFine; }
std::span<const AlignmentStep> StreamSchedule() { return kStream; }
std::span<const AlignmentStep> LocalSchedule() { return std::span(kFine).subspan(3); }
std::span<const AlignmentStep> JointSchedule() { return kJoint; }

void FrameSegments::Assign(std::span<const Segment2> all, size_t max_segments) {
  source.resize(all.size());
  std::iota(source.begin(), source.end(), 0u);
  const size_t kept = std::min(max_segments, all.size());
  std::partial_sort(source.begin(), source.begin() + static_cast<ptrdiff_t>(kept), source.end(),
                    [&](uint32_t a, uint32_t b) {
                      const double length_a = all[a].Delta().squaredNorm();
                      const double length_b = all[b].Delta().squaredNorm();
                      return length_a != length_b ? length_a > length_b : a < b;
                    });
  source.resize(kept);
  segments.clear();
  for (const uint32_t i : source) segments.push_back(all[i]);
  table.Assign(segments);
}

void FineAligner::Observe(std::span<const CandidateLine> lines, const FrameSegments& segments,
                          double sigma_px) {
  const double sigma = std::max(kPixelSigma, 0.5 * sigma_px);
  observations_.clear();
  for (const LinePair& pair : pairs_) {
    const Segment2& segment = segments.segments[pair.segment];
    const Eigen::Vector2d delta = segment.Delta();
    const CandidateLine& line = lines[pair.line];
    observations_.push_back(
        {.line_in_world = line.segment_in_world,
         .part_px = {segment.start + static_cast<double>(pair.begin) * delta,
                     segment.start + static_cast<double>(pair.end) * delta},
         .weight = pair.weight * line.weight * std::min<double>(pair.overlap_px, kOverlapCapPx) /
                   kOverlapUnitPx,
         .variance_px2 = sigma * sigma + map_variance_[pair.line]});
  }
}

FineAlignment FineAligner::Align(const Camera& camera, const Rigid3& start,
                                 std::span<const CandidateLine> lines,
                                 const FrameSegments& segments,
                                 std::span<const AlignmentStep> schedule,
                                 const PosePriorFactor& prior,
                                 std::span<const PointObservation> points) {
  FineAlignment out;
  out.cam_from_world = start;
  map_variance_.clear();
  for (const CandidateLine& line : lines) {
    map_variance_.push_back(MapVariancePx(camera, start, line));
  }
  for (const AlignmentStep& step : schedule) {
    ProjectCandidates(camera, out.cam_from_world, lines, kMinVisiblePx, &projected_);
    associator_.Associate(projected_, segments.table,
                          {.sigma_px = step.sigma_px, .sigma_sine = step.sigma_sine}, &pairs_);
    out.num_pairs = pairs_.size();
    Observe(lines, segments, step.sigma_px);
    if (pairs_.size() < kMinPairs && points.empty()) continue;
    const LineEquations line_terms =
        AccumulateLines(camera, out.cam_from_world, observations_, step.robust);
    out.line_information = line_terms.equations.information;
    out.residual_scale = line_terms.residual_scale;
    NormalEquations equations = PriorEquations(prior, out.cam_from_world);
    if (points.empty()) {
      equations.Add(line_terms.equations);
    } else {
      equations.Add(line_terms.equations,
                    1.0 / std::max(line_terms.residual_scale, kMinResidualScale));
      const auto point_terms = points_.Accumulate(camera, out.cam_from_world, points);
      equations.Add(point_terms.equations);
      out.point_information = point_terms.equations.information;
      out.num_points = point_terms.num_points;
      out.point_scale = point_terms.scale;
    }
    const auto delta = SolveStep(equations, kMaxRotationStep);
    if (!delta) break;
    out.cam_from_world = Perturb(out.cam_from_world, *delta);
  }
  return out;
}

}  // namespace plumb
