#include "plumb/refine/joint_solver.h"

#include <cmath>
#include <memory>
#include <numbers>

#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "plumb/refine/cost/line_angle.h"
#include "plumb/refine/cost/midpoint_distance.h"
#include "plumb/refine/cost/overlap_distance.h"
#include "plumb/refine/cost/point_reprojection.h"
#include "plumb/refine/cost/pose_prior.h"

namespace plumb {
namespace {

constexpr double kPixelSigma = 0.7;

bool IsFinite(const Segment3& segment) {
  return segment.start.allFinite() && segment.end.allFinite();
}
bool IsFinite(const Segment2& segment) {
  return segment.start.allFinite() && segment.end.allFinite() && segment.Length() > 0.0;
}
bool IsFinite(const PointObservation& point) {
  return point.pixel.allFinite() && point.point_in_world.allFinite() &&
         point.deviation_in_world.allFinite() && point.weight >= 0.0 && std::isfinite(point.weight);
}

bool IsValid(const Camera& camera, const Rigid3& start, const JointSolverOptions& options) {
  return camera.IsValid() && start.IsFinite() && start.rotation.norm() > 0.5 &&
         options.huber_px > 0.0 && std::isfinite(options.huber_px) && options.line_robust > 0.0 &&
         options.point_robust > 0.0 && options.max_iterations >= 1;
}

/// rho(s) = s / (1 + s / scale^2), whose weight is that of AccumulateLines().
class GemanMcClureLoss final : public ceres::LossFunction {
 public:
  explicit GemanMcClureLoss(double scale) : inverse_square_(1.0 / (scale * scale)) {}

  void Evaluate(double s, double rho[3]) const override {
    const double q = 1.0 / (1.0 + s * inverse_square_);
    rho[0] = s * q;
    rho[1] = q * q;
    rho[2] = -2.0 * inverse_square_ * q * q * q;
  }

 private:
  const double inverse_square_;
};

/// One pose, and the residual blocks that can be evaluated at it. Ceres aborts the process on
/// misuse, so that only checked input gets here.
class PoseProblem {
 public:
  explicit PoseProblem(const Rigid3& start) : pose_(start) {
    pose_.rotation.normalize();
    problem_.AddParameterBlock(Rotation(), 4, new ceres::EigenQuaternionManifold);
    problem_.AddParameterBlock(Translation(), 3);
  }

  /// Takes ownership of `cost` and `loss`; nullptr: not robust.
  /// @return false, and adds nothing, when the cost cannot be evaluated at the start.
  bool Add(ceres::CostFunction* cost, ceres::LossFunction* loss, double weight) {
    std::unique_ptr<ceres::CostFunction> owned(cost);
    std::unique_ptr<ceres::LossFunction> owned_loss(loss);
    const double* blocks[] = {Rotation(), Translation()};
    double residuals[6];
    if (!owned->Evaluate(blocks, residuals, nullptr)) return false;
    for (int i = 0; i < owned->num_residuals(); ++i) {
      if (!std::isfinite(residuals[i])) return false;
    }
    problem_.AddResidualBlock(
        owned.release(), new ceres::ScaledLoss(owned_loss.release(), weight, ceres::TAKE_OWNERSHIP),
        Rotation(), Translation());
    return true;
  }

  std::optional<JointSolution> Solve(const JointSolverOptions& options) {
    if (problem_.NumResidualBlocks() == 0) return std::nullopt;
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_QR;
    solver.max_num_iterations = options.max_iterations;
    solver.num_threads = 1;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem_, &summary);
    pose_.rotation.normalize();
    if (!summary.IsSolutionUsable() || !pose_.IsFinite()) return std::nullopt;
    JointSolution solution;
    solution.cam_from_world = pose_;
    solution.initial_cost = summary.initial_cost;
    solution.final_cost = summary.final_cost;
    solution.num_iterations = static_cast<int>(summary.iterations.size());
    return solution;
  }

 private:
  double* Rotation() { return pose_.rotation.coeffs().data(); }
  double* Translation() { return pose_.translation.data(); }

  Rigid3 pose_;
  ceres::Problem problem_;
};

}  // namespace

std::optional<JointSolution> SolvePaperCost(const Camera& camera, const Rigid3& start,
                                            std::span<const PaperLine> lines,
                                            std::span<const PointObservation> points,
                                            const JointSolverOptions& options) {
  if (!IsValid(camera, start, options)) return std::nullopt;
  for (const PaperLine& line : lines) {
    if (!IsFinite(line.line_in_world) || !IsFinite(line.segment_px) ||
        !std::isfinite(line.scale_px)) {
      return std::nullopt;
    }
  }
  for (const PointObservation& point : points) {
    if (!IsFinite(point)) return std::nullopt;
  }
  const double n = static_cast<double>(lines.size()), m = static_cast<double>(points.size());
  const double alpha = points.empty() ? 1.0 : m / (n + m);
  const double beta = lines.empty() ? 1.0 : n / (n + m);

  PoseProblem problem(start);
  int num_lines = 0, num_points = 0;
  for (const PaperLine& line : lines) {
    if (options.paper_residual == LineResidual::kPerpendicular) {
      num_lines +=
          problem.Add(OverlapDistanceCost::Create(camera, line.line_in_world, line.segment_px, 1.0),
                      new ceres::HuberLoss(options.huber_px), alpha);
      continue;
    }
    // A line whose midpoint has no image contributes no angle either.
    if (!problem.Add(MidpointDistanceCost::Create(camera, line.line_in_world, line.segment_px, 1.0),
                     new ceres::HuberLoss(options.huber_px), alpha)) {
      continue;
    }
    problem.Add(LineAngleCost::Create(camera, line.line_in_world, line.segment_px, line.scale_px),
                new ceres::HuberLoss(options.huber_px), alpha);
    ++num_lines;
  }
  for (const PointObservation& point : points) {
    num_points +=
        problem.Add(PointReprojectionCost::Create(camera, point.point_in_world, point.pixel,
                                                  Eigen::Matrix2d::Identity()),
                    new ceres::HuberLoss(options.huber_px), beta);
  }
  auto solution = problem.Solve(options);
  if (solution) {
    solution->num_lines = num_lines;
    solution->num_points = num_points;
  }
  return solution;
}

std::optional<JointSolution> SolveOverlapCost(const Camera& camera, const Rigid3& start,
                                              std::span<const LineObservation> lines,
                                              std::span<const PointObservation> points,
                                              const PosePriorFactor* prior,
                                              const JointSolverOptions& options) {
  if (!IsValid(camera, start, options)) return std::nullopt;
  for (const LineObservation& line : lines) {
    if (!IsFinite(line.line_in_world) || !IsFinite(line.part_px) || !(line.variance_px2 > 0.0) ||
        !std::isfinite(line.variance_px2) || !(line.weight >= 0.0) || !std::isfinite(line.weight)) {
      return std::nullopt;
    }
  }
  for (const PointObservation& point : points) {
    if (!IsFinite(point)) return std::nullopt;
  }
  if (prior && (!prior->cam_from_world.IsFinite() || !(prior->rotation_sigma_rad > 0.0) ||
                !(prior->position_sigma_m > 0.0))) {
    return std::nullopt;
  }

  PoseProblem problem(start);
  int num_lines = 0, num_points = 0;
  // Both ends of a line share one block, hence twice the square of one residual's scale.
  for (const LineObservation& line : lines) {
    const double sigma = std::sqrt(line.variance_px2);
    num_lines += problem.Add(
        OverlapDistanceCost::Create(camera, line.line_in_world, line.part_px, 1.0 / sigma),
        new GemanMcClureLoss(options.line_robust * std::numbers::sqrt2), line.weight);
  }
  const Eigen::Matrix3d rotation = start.RotationMatrix();
  for (const PointObservation& point : points) {
    const Eigen::Vector3d x = rotation * point.point_in_world + start.translation;
    if (!(x.z() > kNearPlane)) continue;
    const Eigen::Vector3d d = rotation * point.deviation_in_world;
    const Eigen::Vector2d j(camera.fx * (d.x() - x.x() / x.z() * d.z()) / x.z(),
                            camera.fy * (d.y() - x.y() / x.z() * d.z()) / x.z());
    const Eigen::Matrix2d covariance =
        kPixelSigma * kPixelSigma * Eigen::Matrix2d::Identity() + j * j.transpose();
    num_points += problem.Add(
        PointReprojectionCost::Create(camera, point.point_in_world, point.pixel,
                                      PointReprojectionCost::FromCovariance(covariance)),
        new GemanMcClureLoss(options.point_robust), point.weight);
  }
  if (num_lines + num_points == 0) return std::nullopt;
  if (prior) {
    problem.Add(PosePriorCost::Create(prior->cam_from_world, prior->rotation_sigma_rad,
                                      prior->position_sigma_m),
                nullptr, 1.0);
  }
  auto solution = problem.Solve(options);
  if (solution) {
    solution->num_lines = num_lines;
    solution->num_points = num_points;
  }
  return solution;
}

}  // namespace plumb
