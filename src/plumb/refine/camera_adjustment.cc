#include "plumb/refine/camera_adjustment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <vector>

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "plumb/refine/cost/line_in_camera.h"
#include "plumb/refine/line_problem.h"
#include "plumb/refine/quiet_ceres.h"

namespace plumb {
namespace {

constexpr double kMinLength = 1e-6;  // [m]
constexpr double kStep = 1e-4;       // of the differences by the camera
constexpr double kConverged = 1e-5;  // largest change of a round

using Changes = Eigen::Matrix<double, kNumCameraChanges, 1>;

// Ceres aborts the process on misuse, so that only checked input may get there.
bool IsValid(std::span<const Rigid3> poses, std::span<const Segment3> lines,
             std::span<const CameraSighting> sightings, const CameraAdjustmentOptions& options) {
  return IsPositive(options.pixel_sigma_px) && IsPositive(options.cauchy_scale) &&
         IsPositive(options.focal_sigma) && IsPositive(options.centre_sigma) &&
         IsPositive(options.distortion_sigma) && options.max_rounds >= 1 &&
         options.max_iterations >= 1 && std::all_of(poses.begin(), poses.end(), IsPose) &&
         std::all_of(lines.begin(), lines.end(),
                     [](const Segment3& line) { return IsFinite(line); }) &&
         std::all_of(sightings.begin(), sightings.end(), [&](const CameraSighting& sighting) {
           return sighting.view < poses.size() && sighting.line < lines.size() &&
                  IsFinite(sighting.segment_px);
         });
}

ImageCamera Changed(ImageCamera camera, const Changes& changes) {
  Camera& pinhole = camera.pinhole;
  pinhole.cx += changes[1] * pinhole.fx;
  pinhole.cy += changes[2] * pinhole.fy;
  pinhole.fx *= std::exp(changes[0]);
  pinhole.fy *= std::exp(changes[0]);
  camera.lens.coefficients[0] += changes[3];
  camera.lens.coefficients[1] += changes[4];
  return camera;
}

// From pixels to the plane z = 1 by a camera and by its neighbours in every change.
class LinearUndistortion {
 public:
  static std::optional<LinearUndistortion> Create(const ImageCamera& camera) {
    LinearUndistortion out;
    const auto add = [&out](const ImageCamera& changed) {
      const Result<LensMapping> mapping = LensMapping::Create(changed.lens);
      if (!mapping) return false;
      out.cameras_[out.count_] = changed.pinhole;
      out.mappings_[out.count_++] = *mapping;
      return true;
    };
    if (!add(camera)) return std::nullopt;
    for (int i = 0; i < kNumCameraChanges; ++i) {
      for (const double step : {-kStep, kStep}) {
        if (!add(Changed(camera, step * Changes::Unit(i)))) return std::nullopt;
      }
    }
    return out;
  }

  std::optional<LinearRay> operator()(const Eigen::Vector2d& px) const {
    std::array<Eigen::Vector2d, 1 + 2 * kNumCameraChanges> rays;
    for (size_t i = 0; i < rays.size(); ++i) {
      const auto ray = mappings_[i].Undistort(cameras_[i].Normalize(px));
      if (!ray) return std::nullopt;
      rays[i] = *ray;
    }
    LinearRay out;
    out.normalized = rays[0];
    for (int i = 0; i < kNumCameraChanges; ++i) {
      const size_t at = 1 + 2 * static_cast<size_t>(i);
      out.by_camera.col(i) = (rays[at + 1] - rays[at]) / (2.0 * kStep);
    }
    return out;
  }

 private:
  std::array<Camera, 1 + 2 * kNumCameraChanges> cameras_;
  std::array<LensMapping, 1 + 2 * kNumCameraChanges> mappings_;
  size_t count_ = 0;
};

class CameraProblem {
 public:
  CameraProblem(const ImageCamera& start, std::span<const Rigid3> poses,
                std::span<const Segment3> lines, const CameraAdjustmentOptions& options)
      : options_(options),
        start_(start),
        unit_focal_px_(
            options.unit_focal_px.value_or(Eigen::Vector2d(start.pinhole.fx, start.pinhole.fy))),
        camera_(start),
        poses_(poses) {
    for (const Segment3& line : lines) {
      anchored_.push_back(line.Length() > kMinLength ? std::optional(AnchorOf(line))
                                                     : std::nullopt);
    }
    deltas_.assign(lines.size(), {});
  }

  /// One linearisation of the undistortion. @return the largest change; nullopt: no step.
  std::optional<double> Round(std::span<const CameraSighting> sightings) {
    const auto undistortion = LinearUndistortion::Create(camera_);
    if (!undistortion) return std::nullopt;
    ceres::Problem::Options borrowing;
    borrowing.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(borrowing);
    ceres::CauchyLoss loss(options_.cauchy_scale);
    Changes changes = Changes::Zero();
    for (const CameraSighting& sighting : sightings) {
      Add(sighting, *undistortion, &loss, changes.data(), &problem);
    }
    const int num_sightings = problem.NumResidualBlocks();
    if (num_sightings == 0) return std::nullopt;
    if (options_.camera_is_fixed) problem.SetParameterBlockConstant(changes.data());
    AddPrior(changes.data(), &problem);

    ceres::Solver::Options solver = EliminateLines(problem, deltas_, options_.max_iterations);
    solver.linear_solver_ordering->AddElementToGroup(changes.data(), 1);
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    if (!summary.IsSolutionUsable() || !changes.allFinite()) return std::nullopt;
    camera_ = Changed(camera_, changes);
    cost_ = summary.final_cost;
    num_sightings_ = static_cast<size_t>(num_sightings);
    return changes.cwiseAbs().maxCoeff();
  }

  AdjustedCamera Result() const { return {camera_, cost_, num_sightings_}; }

 private:
  // Takes no block that has no value at the start (a line through the camera's centre).
  void Add(const CameraSighting& sighting, const LinearUndistortion& undistortion,
           ceres::LossFunction* loss, double* changes, ceres::Problem* problem) {
    std::optional<AnchoredSegment> line = anchored_[sighting.line];
    const auto start = undistortion(sighting.segment_px.start);
    const auto end = undistortion(sighting.segment_px.end);
    if (!line || !start || !end) return;
    const Rigid3& pose = poses_[sighting.view];
    line->anchors_in_world = {pose * line->anchors_in_world.start,
                              pose * line->anchors_in_world.end};
    line->across = pose.RotationMatrix() * line->across;
    // Pixels of an ideal image; those of the image as taken differ by what the lens
    // stretches there.
    std::unique_ptr<ceres::CostFunction> cost(
        LineInCameraCost::Create(*line, unit_focal_px_, *start, *end, options_.pixel_sigma_px));
    double* const delta = deltas_[sighting.line].data();
    const double* const blocks[] = {changes, delta};
    std::array<double, 2> residuals = {};
    if (!cost->Evaluate(blocks, residuals.data(), nullptr) || !std::isfinite(residuals[0]) ||
        !std::isfinite(residuals[1])) {
      return;
    }
    problem->AddResidualBlock(cost.release(), loss, changes, delta);
  }

  // About the start, not about the round before.
  void AddPrior(double* changes, ceres::Problem* problem) const {
    if (options_.camera_is_fixed) return;
    Changes sigma;
    sigma << options_.focal_sigma, Eigen::Vector2d::Constant(options_.centre_sigma),
        Eigen::Vector2d::Constant(options_.distortion_sigma);
    Changes from_here;
    const Camera &now = camera_.pinhole, &then = start_.pinhole;
    from_here << std::log(then.fx / now.fx), (then.cx - now.cx) / now.fx,
        (then.cy - now.cy) / now.fy, start_.lens.coefficients[0] - camera_.lens.coefficients[0],
        start_.lens.coefficients[1] - camera_.lens.coefficients[1];
    problem->AddResidualBlock(
        new ceres::NormalPrior(ceres::Matrix(sigma.cwiseInverse().asDiagonal()), from_here),
        nullptr, changes);
  }

  const CameraAdjustmentOptions options_;
  const ImageCamera start_;
  const Eigen::Vector2d unit_focal_px_;
  ImageCamera camera_;
  const std::span<const Rigid3> poses_;
  std::vector<std::optional<AnchoredSegment>> anchored_;
  std::vector<std::array<double, 4>> deltas_;
  double cost_ = 0.0;
  size_t num_sightings_ = 0;
};

}  // namespace

std::optional<AdjustedCamera> AdjustCamera(const ImageCamera& start,
                                           std::span<const Rigid3> cam_from_world,
                                           std::span<const Segment3> lines_in_world,
                                           std::span<const CameraSighting> sightings,
                                           const CameraAdjustmentOptions& options) {
  if (!start.pinhole.IsValid() || !IsValid(cam_from_world, lines_in_world, sightings, options)) {
    return std::nullopt;
  }
  QuietCeres();
  ImageCamera camera = start;
  if (camera.lens.IsNone()) camera.lens.model = LensModel::kRadTan;
  CameraProblem problem(camera, cam_from_world, lines_in_world, options);
  for (int round = 0; round < options.max_rounds; ++round) {
    const std::optional<double> change = problem.Round(sightings);
    if (!change && round == 0) return std::nullopt;
    if (!change || *change < kConverged) break;
  }
  return problem.Result();
}

}  // namespace plumb
