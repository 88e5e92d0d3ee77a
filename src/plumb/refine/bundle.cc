#include "plumb/refine/bundle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Geometry>

#include "plumb/refine/cost/line_in_view.h"
#include "plumb/refine/cost/pose_prior.h"
#include "plumb/refine/line_problem.h"
#include "plumb/refine/quiet_ceres.h"

namespace plumb {
namespace {

constexpr double kMinLength = 1e-6;  // [m]
constexpr size_t kMaxDensePoses = 500;

// Ceres aborts the process on misuse, so that only checked input may get there.
bool IsValid(std::span<const BundleView> views, std::span<const Segment3> lines,
             std::span<const BundleSighting> sightings, const BundleOptions& options) {
  const auto is_view = [](const BundleView& view) {
    return IsPose(view.prior) && IsPose(view.start) && view.focal_px.allFinite() &&
           view.focal_px.x() != 0.0 && view.focal_px.y() != 0.0;
  };
  const auto is_sighting = [&](const BundleSighting& sighting) {
    return sighting.view < views.size() && sighting.line < lines.size() &&
           IsFinite(sighting.segment_normalized) &&
           (!sighting.lifted_in_cam ||
            (IsFinite(*sighting.lifted_in_cam) && IsPositive(sighting.depth_sigma_m)));
  };
  return !views.empty() && IsPositive(options.position_sigma_m) &&
         IsPositive(options.rotation_sigma_rad) && IsPositive(options.pixel_sigma_px) &&
         IsPositive(options.cauchy_scale) && options.max_iterations >= 1 &&
         std::all_of(views.begin(), views.end(), is_view) &&
         std::all_of(lines.begin(), lines.end(),
                     [](const Segment3& line) { return IsFinite(line); }) &&
         std::all_of(sightings.begin(), sightings.end(), is_sighting);
}

class BundleProblem {
 public:
  BundleProblem(std::span<const BundleView> views, std::span<const Segment3> lines,
                const BundleOptions& options)
      : options_(options), loss_(options.cauchy_scale), lines_(lines.begin(), lines.end()) {
    poses_.reserve(views.size());  // Ceres keeps pointers
    for (const BundleView& view : views) {
      Rigid3& pose = poses_.emplace_back(view.start);
      pose.rotation.normalize();
      problem_.AddParameterBlock(pose.rotation.coeffs().data(), 4, &manifold_);
      problem_.AddParameterBlock(pose.translation.data(), 3);
      problem_.AddResidualBlock(
          PosePriorCost::Create({view.prior.rotation.normalized(), view.prior.translation},
                                options.rotation_sigma_rad, options.position_sigma_m),
          nullptr, pose.rotation.coeffs().data(), pose.translation.data());
    }
    anchored_.resize(lines.size());
    for (size_t i = 0; i < lines.size(); ++i) {
      if (lines[i].Length() > kMinLength) anchored_[i] = AnchorOf(lines[i]);
    }
    deltas_.assign(lines.size(), {});
  }

  void Add(const BundleSighting& sighting, const Eigen::Vector2d& focal_px) {
    const std::optional<AnchoredSegment>& line = anchored_[sighting.line];
    if (!line) return;
    AddBlock(LineInViewCost::Create(*line, focal_px, sighting.segment_normalized,
                                    options_.pixel_sigma_px),
             sighting);
    if (!sighting.lifted_in_cam) return;
    for (const Eigen::Vector3d& end :
         {sighting.lifted_in_cam->start, sighting.lifted_in_cam->end}) {
      AddBlock(LiftedPointCost::Create(*line, end, sighting.depth_sigma_m), sighting);
    }
  }

  std::optional<Bundle> Solve() {
    ceres::Solver::Options solver = EliminateLines(problem_, deltas_, options_.max_iterations);
    // Without the lines 7 columns a pose are left.
    if (poses_.size() > kMaxDensePoses) {
      solver.linear_solver_type = ceres::ITERATIVE_SCHUR;
      solver.preconditioner_type = ceres::SCHUR_JACOBI;
    }
    for (Rigid3& pose : poses_) {
      solver.linear_solver_ordering->AddElementToGroup(pose.rotation.coeffs().data(), 1);
      solver.linear_solver_ordering->AddElementToGroup(pose.translation.data(), 1);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem_, &summary);
    if (!summary.IsSolutionUsable()) return std::nullopt;

    Bundle bundle{poses_, lines_, summary.initial_cost, summary.final_cost};
    for (Rigid3& pose : bundle.cam_from_world) {
      pose.rotation.normalize();
      if (!pose.IsFinite()) return std::nullopt;
    }
    for (size_t i = 0; i < lines_.size(); ++i) {
      Segment3& line = bundle.lines_in_world[i];
      if (anchored_[i]) anchored_[i]->Place(deltas_[i].data(), &line.start, &line.end);
      if (!IsFinite(line)) return std::nullopt;
    }
    return bundle;
  }

 private:
  // Takes `raw`. What has no value at the start (a line through the camera's centre) is left out.
  void AddBlock(ceres::CostFunction* raw, const BundleSighting& sighting) {
    std::unique_ptr<ceres::CostFunction> cost(raw);
    Rigid3& pose = poses_[sighting.view];
    double* const blocks[] = {pose.rotation.coeffs().data(), pose.translation.data(),
                              deltas_[sighting.line].data()};
    std::array<double, 3> residuals = {};
    if (!cost->Evaluate(blocks, residuals.data(), nullptr)) return;
    for (const double residual : residuals) {
      if (!std::isfinite(residual)) return;
    }
    problem_.AddResidualBlock(cost.release(), &loss_, blocks[0], blocks[1], blocks[2]);
  }

  static ceres::Problem::Options Borrowing() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  const BundleOptions options_;
  ceres::CauchyLoss loss_;
  ceres::EigenQuaternionManifold manifold_;
  std::vector<Rigid3> poses_;
  std::vector<Segment3> lines_;
  std::vector<std::optional<AnchoredSegment>> anchored_;
  std::vector<std::array<double, 4>> deltas_;
  ceres::Problem problem_{Borrowing()};
};

}  // namespace

std::optional<Bundle> AdjustBundle(std::span<const BundleView> views,
                                   std::span<const Segment3> lines_in_world,
                                   std::span<const BundleSighting> sightings,
                                   const BundleOptions& options) {
  if (!IsValid(views, lines_in_world, sightings, options)) return std::nullopt;
  QuietCeres();
  BundleProblem problem(views, lines_in_world, options);
  for (const BundleSighting& sighting : sightings) {
    problem.Add(sighting, views[sighting.view].focal_px);
  }
  return problem.Solve();
}

}  // namespace plumb
