#include "plumb/runtime/point_solver.h"

namespace plumb {
namespace {

constexpr int kMaxSteps = 15;
constexpr double kMaxRotationStep = 0.1;
constexpr double kConvergedStep = 1e-7;

}  // namespace

PointPose PointSolver::Solve(const Camera& camera, const PosePriorFactor& prior,
                             const PointTable& points) {
  PointPose out{prior.cam_from_world};
  for (int step = 0; step < kMaxSteps; ++step) {
    NormalEquations equations = PriorEquations(prior, out.cam_from_world);
    equations.Add(accumulator_.Accumulate(camera, out.cam_from_world, points).equations);
    const auto delta = SolveStep(equations, kMaxRotationStep);
    if (!delta) return out;
    out.cam_from_world = Perturb(out.cam_from_world, *delta);
    if (delta->norm() < kConvergedStep) break;
  }
  accumulator_.FindNear(camera, out.cam_from_world, points, kNearPointPx, &near_);
  out.num_inliers = near_.size();
  return out;
}

}  // namespace plumb
