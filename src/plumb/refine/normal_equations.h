// Normal equations of a pose: what every Gauss-Newton step of the refinement adds up and solves.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// J^T W J and J^T W r for the left perturbation (w, v) of cam_from_world.
struct NormalEquations {
  Matrix6d information = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();

  void Add(const NormalEquations& other, double factor = 1.0);
};

/// A part of a detected segment that lies on a 3D line.
struct LineObservation {
  Segment3 line_in_world;
  Segment2 part_px;           // the overlap's ends, on the detected segment
  double weight = 1.0;        // >= 0, times 1 / variance
  double variance_px2 = 1.0;  // of the distance between part and projected line, > 0
};

/// Signed distance [px] of `point_px` to the image of the infinite line through a, b (camera
/// coordinates), and its derivative by the perturbation. With n = a x b and m = (n_x / fx,
/// n_y / fy): r = n . x / |m|, x = (Normalize(point), 1).
/// @return nullopt when the line has no image (kMinRaySine).
struct PointLineDistance {
  double residual_px = 0.0;
  Vector6d jacobian = Vector6d::Zero();
};
std::optional<PointLineDistance> DistanceToLine(const Camera& camera, const Eigen::Vector3d& a,
                                                const Eigen::Vector3d& b,
                                                const Eigen::Vector2d& point_px);

/// Line terms and the scale of their residuals.
struct LineEquations {
  NormalEquations equations;
  /// sum(w r^2) / sum(w variance): 1 when the variances are right. 1 without observations.
  double residual_scale = 1.0;
  int num_residuals = 0;
};

/// Adds both ends of every observation with the Geman-McClure weight weight / variance / (1 +
/// r^2 / (robust^2 variance))^2. Observations whose line has no image are skipped.
/// Source: docs/method/association.md.
LineEquations AccumulateLines(const Camera& camera, const Rigid3& cam_from_world,
                              std::span<const LineObservation> observations, double robust);

/// A 2D-3D point correspondence.
struct PointObservation {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  /// One standard deviation of the point along the ray that made it, as a vector [m].
  Eigen::Vector3d deviation_in_world = Eigen::Vector3d::Zero();
  /// Share of one observation that it counts for, >= 0.
  double weight = 1.0;
};

/// Point terms: covariance of a residual = 0.7^2 I + j j^T, j the image of the deviation; whitened
/// squares are divided by their median / 1.386 (at least 0.09), Geman-McClure at 3 sigma. Points
/// nearer than kNearPlane are skipped.
/// Source: docs/method/association.md.
///
/// Owns its work space, so that repeated calls do not allocate; not thread-safe.
class PointAccumulator {
 public:
  struct Equations {
    NormalEquations equations;
    int num_points = 0;
    double scale = 1.0;  // by which the whitened squares were divided; 1 without points
  };
  Equations Accumulate(const Camera& camera, const Rigid3& cam_from_world,
                       std::span<const PointObservation> points);

 private:
  struct Residual {
    Eigen::Vector2d error;
    Eigen::Matrix<double, 2, 6> jacobian;
    Eigen::Matrix2d inverse_covariance;
    double square, weight;
  };
  std::vector<Residual> residuals_;
  std::vector<double> squares_;
};

/// A rotation that is known better across an axis than about it.
struct TiltPrior {
  Eigen::Vector3d axis_in_camera = Eigen::Vector3d::UnitY();  // unit
  double sigma_rad = 1.0;                                     // of each component across the axis
};

/// Gaussian prior on the pose.
struct PosePriorFactor {
  Rigid3 cam_from_world;
  double rotation_sigma_rad = 1.0;  // per component of the weight: information 1 / sigma^2
  double position_sigma_m = 10.0;
  std::optional<TiltPrior> tilt = std::nullopt;  // then rotation_sigma_rad is about its axis only

  Matrix6d Information() const;
};

/// The prior's terms at `cam_from_world`.
NormalEquations PriorEquations(const PosePriorFactor& prior, const Rigid3& cam_from_world);

/// One Gauss-Newton step -(H + 1e-6 I)^-1 g, its rotation shortened to `max_rotation_rad`.
/// @return nullopt when H is not finite or not positive definite.
std::optional<Vector6d> SolveStep(const NormalEquations& equations, double max_rotation_rad);

}  // namespace plumb
