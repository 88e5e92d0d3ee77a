#include "plumb/runtime/one_to_one_solver.h"

namespace plumb {
namespace {

constexpr int kMaxRematches = 3;
constexpr size_t kMinMatches = 4;

}  // namespace

void OneToOneSolver::Solve(const Camera& camera, std::span<const Segment2> segments,
                           std::span<const Segment3> lines,
                           std::span<const MatchCandidate> candidates,
                           std::span<const PointObservation> points, LineResidual residual,
                           Rigid3* cam_from_world) {
  assignments_.clear();
  for (int rematch = 0; rematch < kMaxRematches; ++rematch) {
    AssignOneToOne(camera, *cam_from_world, segments, lines, candidates, ReprojectionGates{},
                   &assignments_);
    if (assignments_.size() < kMinMatches) return;
    paper_lines_.clear();
    for (const LineAssignment& match : assignments_) {
      paper_lines_.push_back(
          {lines[match.line], segments[match.segment], match.projected_length_px});
    }
    const auto solution =
        SolvePaperCost(camera, *cam_from_world, paper_lines_, points, {.paper_residual = residual});
    if (!solution) return;
    *cam_from_world = solution->cam_from_world;
  }
}

}  // namespace plumb
