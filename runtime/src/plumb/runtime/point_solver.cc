#include "plumb/runtime/point_solver.h"

#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr double kGatePx = 10.0;
constexpr int kMaxSteps = 15;
constexpr double kMaxRotationStep = 0.1;
constexpr double kConvergedStep = 1e-7;

}  // namespace

bool ReprojectsNear(const Camera& camera, const Rigid3& cam_from_world,
                    const PointObservation& point) {
  const Eigen::Vector3d x = cam_from_world * point.point_in_world;
  return x.z() > kNearPlane && (camera.Project(x) - point.pixel).norm() < kGatePx;
}

PointPose PointSolver::Solve(const Camera& camera, const PosePriorFactor& prior,
                             std::span<const PointObservation> points) {
  PointPose out{prior.cam_from_world};
  for (int step = 0; step < kMaxSteps; ++step) {
    NormalEquations equations = PriorEquations(prior, out.cam_from_world);
    equations.Add(accumulator_.Accumulate(camera, out.cam_from_world, points).equations);
    const auto delta = SolveStep(equations, kMaxRotationStep);
    if (!delta) return out;
    out.cam_from_world = Perturb(out.cam_from_world, *delta);
    if (delta->norm() < kConvergedStep) break;
  }
  for (const PointObservation& point : points) {
    out.num_inliers += ReprojectsNear(camera, out.cam_from_world, point) ? 1 : 0;
  }
  return out;
}

}  // namespace plumb
