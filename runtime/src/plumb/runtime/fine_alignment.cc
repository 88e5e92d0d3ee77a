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

constexpr double kPixelSigma = 0.7;
constexpr float kOverlapCapPx = 120.0f, kOverlapUnitPx = 30.0f;
// How far the image may move before pairs are listed anew, and the depth at which a translation
// moves it so far.
constexpr double kSlackPx = 3.0, kUsualDepthM = 1.0;
// A step that moves the image so little ends those with the same gates; so short a step the last
// ones.
constexpr double kConvergedPx = 0.01, kConvergedStep = 1e-6;
constexpr size_t kMinPairs = 4;
constexpr double kMaxRotationStep = 0.1;
constexpr double kMinResidualScale = 0.02;
// Weight of lines beside points. A segment counts for every line that it meets, a long one up to
// four times: together they promise more than they hold. docs/adr/0018.
constexpr double kLineShare = 0.3;

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

void FineAligner::Begin(const Camera& camera, const Rigid3& reference,
                        std::span<const CandidateLine> lines, const FrameSegments& segments) {
  camera_ = camera;
  segments_ = &segments;
  lines_.Assign(lines, reference);
  map_variance_.clear();
  for (const CandidateLine& line : lines) {
    map_variance_.push_back(static_cast<float>(MapVariancePx(camera, reference, line)));
  }
  listed_sigma_px_ = 0.0;
}

void FineAligner::ListPairs(const AlignmentStep& step) {
  // A pair that is inside the gate now was inside the wider one when the list was made, unless the
  // image has moved by more than the difference.
  const double room_px = kSlackPx + 3.0 * (listed_sigma_px_ - step.sigma_px);
  if (listed_sigma_px_ >= step.sigma_px && moved_px_ <= room_px) return;
  list_.Build(projected_, segments_->table,
              {.sigma_px = step.sigma_px, .sigma_sine = step.sigma_sine}, kSlackPx);
  listed_sigma_px_ = step.sigma_px;
  moved_px_ = 0.0;
}

void FineAligner::Observe(double sigma_px) {
  const PairList::Pairs& pairs = list_.pairs();
  const auto sigma = static_cast<float>(std::max(kPixelSigma, 0.5 * sigma_px));
  observations_.Resize(pairs.size());
  for (size_t p = 0; p < pairs.size(); ++p) {
    const auto line = static_cast<size_t>(pairs.line[p]);
    observations_.line[p] = pairs.line[p];
    observations_.x0[p] = pairs.x0[p];
    observations_.y0[p] = pairs.y0[p];
    observations_.x1[p] = pairs.x1[p];
    observations_.y1[p] = pairs.y1[p];
    observations_.weight[p] = pairs.weight[p] * lines_.weight[line] *
                              std::min(pairs.overlap[p], kOverlapCapPx) / kOverlapUnitPx;
    observations_.variance_px2[p] = sigma * sigma + map_variance_[line];
  }
}

LineEnds FineAligner::Ends() const {
  return {projected_.start_x.data(), projected_.start_y.data(), projected_.start_z.data(),
          projected_.end_x.data(),   projected_.end_y.data(),   projected_.end_z.data()};
}

FineAlignment FineAligner::Run(const Rigid3& start, std::span<const AlignmentStep> schedule,
                               const PosePriorFactor& prior, const PointTable* points) {
  FineAlignment out;
  out.cam_from_world = start;
  const AlignmentStep* converged = nullptr;
  for (const AlignmentStep& step : schedule) {
    if (converged != nullptr && *converged == step) continue;
    ProjectTable(camera_, out.cam_from_world, lines_, kMinVisiblePx, &projected_);
    ListPairs(step);
    list_.Weigh(projected_, {.sigma_px = step.sigma_px, .sigma_sine = step.sigma_sine});
    out.num_pairs = list_.pairs().size();
    if (out.num_pairs < kMinPairs && points == nullptr) continue;
    Observe(step.sigma_px);
    const LineEquations line_terms =
        line_terms_.Accumulate(camera_, Ends(), observations_, step.robust, LineLoss::kEachEnd);
    out.line_information = line_terms.equations.information;
    out.residual_scale = line_terms.residual_scale;
    NormalEquations equations = PriorEquations(prior, out.cam_from_world);
    if (points == nullptr) {
      equations.Add(line_terms.equations);
    } else {
      equations.Add(line_terms.equations,
                    kLineShare / std::max(line_terms.residual_scale, kMinResidualScale));
      const auto terms = point_terms_.Accumulate(camera_, out.cam_from_world, *points);
      equations.Add(terms.equations);
      out.point_information = terms.equations.information;
      out.num_points = terms.num_points;
      out.point_scale = terms.scale;
    }
    const auto delta = SolveStep(equations, kMaxRotationStep);
    if (!delta) break;
    out.cam_from_world = Perturb(out.cam_from_world, *delta);
    const double moved_px =
        camera_.MeanFocal() * (delta->head<3>().norm() + delta->tail<3>().norm() / kUsualDepthM);
    moved_px_ += moved_px;
    if (moved_px < kConvergedPx) converged = &step;
  }
  return out;
}

Rigid3 FineAligner::Polish(const FineAlignment& alignment, double robust, int max_steps,
                           const PosePriorFactor& prior, const PointTable& points) {
  Rigid3 pose = alignment.cam_from_world;
  for (int step = 0; step < max_steps; ++step) {
    ProjectTable(camera_, pose, lines_, kMinVisiblePx, &projected_);
    NormalEquations equations = PriorEquations(prior, pose);
    equations.Add(
        line_terms_.Accumulate(camera_, Ends(), observations_, robust, LineLoss::kBothEnds)
            .equations,
        kLineShare / std::max(alignment.residual_scale, kMinResidualScale));
    equations.Add(point_terms_.Accumulate(camera_, pose, points, alignment.point_scale).equations);
    const auto delta = SolveStep(equations, kMaxRotationStep);
    if (!delta) break;
    pose = Perturb(pose, *delta);
    if (delta->norm() < kConvergedStep) break;
  }
  return pose;
}

}  // namespace plumb
