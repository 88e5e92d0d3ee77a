#include "plumb/refine/normal_equations.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "plumb/base/median.h"
#include "plumb/base/solve6.h"
#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr double kPixelSigma = 0.7;
constexpr double kMedianOfChiSquare2 = 1.386;
constexpr double kMinPointScale = 0.09;
constexpr double kPointRobustSigmas = 3.0;
constexpr double kDamping = 1e-6;

// Adds w J J^T to the lower triangle; Symmetrize() completes it once at the end.
void AddRankOne(const Vector6d& jacobian, double residual, double weight, NormalEquations* out) {
  for (int column = 0; column < 6; ++column) {
    const double scaled = weight * jacobian[column];
    for (int row = column; row < 6; ++row) out->information(row, column) += scaled * jacobian[row];
    out->gradient[column] += scaled * residual;
  }
}

void Symmetrize(NormalEquations* equations) {
  equations->information.triangularView<Eigen::StrictlyUpper>() =
      equations->information.transpose();
}

/// What all points of one line share.
struct LineImage {
  LineImage(const Camera& camera, const Eigen::Vector3d& a, const Eigen::Vector3d& b)
      : normal(a.cross(b)), delta(b - a) {
    exists = normal.head<2>().squaredNorm() >
             kMinRaySine * kMinRaySine * a.squaredNorm() * b.squaredNorm();  // False for NaN.
    m = {normal.x() / (camera.fx * camera.fx), normal.y() / (camera.fy * camera.fy), 0.0};
    inverse_norm = 1.0 / std::sqrt(normal.x() * m.x() + normal.y() * m.y());
  }

  PointLineDistance DistanceOf(const Camera& camera, const Eigen::Vector2d& point_px) const {
    const Eigen::Vector3d x((point_px.x() - camera.cx) / camera.fx,
                            (point_px.y() - camera.cy) / camera.fy, 1.0);
    PointLineDistance out;
    out.residual_px = normal.dot(x) * inverse_norm;
    // d residual / d normal
    const Eigen::Vector3d q = (x - (out.residual_px * inverse_norm) * m) * inverse_norm;
    out.jacobian << normal.cross(q), delta.cross(q);
    return out;
  }

  Eigen::Vector3d normal, delta, m;
  double inverse_norm;
  bool exists;
};

}  // namespace

void NormalEquations::Add(const NormalEquations& other, double factor) {
  information += factor * other.information;
  gradient += factor * other.gradient;
}

std::optional<PointLineDistance> DistanceToLine(const Camera& camera, const Eigen::Vector3d& a,
                                                const Eigen::Vector3d& b,
                                                const Eigen::Vector2d& point_px) {
  const LineImage image(camera, a, b);
  if (!image.exists) return std::nullopt;
  return image.DistanceOf(camera, point_px);
}

LineEquations AccumulateLines(const Camera& camera, const Rigid3& cam_from_world,
                              std::span<const LineObservation> observations, double robust) {
  LineEquations out;
  const Eigen::Matrix3d rotation = cam_from_world.RotationMatrix();
  double weighted_squares = 0.0, weighted_variances = 0.0;
  for (const LineObservation& observation : observations) {
    const Eigen::Vector3d a =
        rotation * observation.line_in_world.start + cam_from_world.translation;
    const Eigen::Vector3d b = rotation * observation.line_in_world.end + cam_from_world.translation;
    const double variance = observation.variance_px2;
    const LineImage image(camera, a, b);
    if (!image.exists) continue;
    for (const Eigen::Vector2d* point : {&observation.part_px.start, &observation.part_px.end}) {
      const PointLineDistance distance = image.DistanceOf(camera, *point);
      const double square = distance.residual_px * distance.residual_px;
      const double q = 1.0 + square / (robust * robust * variance);
      const double weight = observation.weight / (variance * q * q);
      AddRankOne(distance.jacobian, distance.residual_px, weight, &out.equations);
      weighted_squares += weight * square;
      weighted_variances += weight * variance;
      ++out.num_residuals;
    }
  }
  Symmetrize(&out.equations);
  if (weighted_variances > 0.0) {
    out.residual_scale = weighted_squares / std::max(weighted_variances, 1e-9);
  }
  return out;
}

PointAccumulator::Equations PointAccumulator::Accumulate(const Camera& camera,
                                                         const Rigid3& cam_from_world,
                                                         std::span<const PointObservation> points) {
  const Eigen::Matrix3d rotation = cam_from_world.RotationMatrix();
  residuals_.clear();
  squares_.clear();
  for (const PointObservation& point : points) {
    const Eigen::Vector3d x_in_cam = rotation * point.point_in_world + cam_from_world.translation;
    if (!(x_in_cam.z() > kNearPlane)) continue;
    const Eigen::Vector3d deviation = rotation * point.deviation_in_world;
    const double inverse_depth = 1.0 / x_in_cam.z();
    const double x = x_in_cam.x() * inverse_depth, y = x_in_cam.y() * inverse_depth;
    Residual& r = residuals_.emplace_back();
    r.weight = point.weight;
    r.error = camera.Project(x_in_cam) - point.pixel;
    r.jacobian << -x * y, 1.0 + x * x, -y, inverse_depth, 0.0, -x * inverse_depth,  //
        -(1.0 + y * y), x * y, x, 0.0, inverse_depth, -y * inverse_depth;
    r.jacobian.row(0) *= camera.fx;
    r.jacobian.row(1) *= camera.fy;
    const Eigen::Vector2d j(camera.fx * (deviation.x() - x * deviation.z()) * inverse_depth,
                            camera.fy * (deviation.y() - y * deviation.z()) * inverse_depth);
    // Sherman-Morrison inverse of sigma^2 I + j j^T.
    constexpr double kVariance = kPixelSigma * kPixelSigma;
    r.inverse_covariance =
        (Eigen::Matrix2d::Identity() - j * j.transpose() / (kVariance + j.squaredNorm())) /
        kVariance;
    r.square = r.error.dot(r.inverse_covariance * r.error);
    squares_.push_back(r.square);
  }
  Equations out;
  if (residuals_.empty()) return out;
  const double scale = std::max(Median(squares_) / kMedianOfChiSquare2, kMinPointScale);
  for (const Residual& r : residuals_) {
    const double q = 1.0 + r.square / (scale * kPointRobustSigmas * kPointRobustSigmas);
    const double weight = r.weight / (scale * q * q);
    const Eigen::Matrix<double, 6, 2> weighted =
        weight * r.jacobian.transpose() * r.inverse_covariance;
    out.equations.information += weighted * r.jacobian;
    out.equations.gradient += weighted * r.error;
  }
  out.num_points = static_cast<int>(residuals_.size());
  out.scale = scale;
  return out;
}

Matrix6d PosePriorFactor::Information() const {
  Vector6d diagonal;
  diagonal << Eigen::Vector3d::Constant(1.0 / (rotation_sigma_rad * rotation_sigma_rad)),
      Eigen::Vector3d::Constant(1.0 / (position_sigma_m * position_sigma_m));
  Matrix6d information = diagonal.asDiagonal();
  if (tilt) {
    const Eigen::Matrix3d about = tilt->axis_in_camera * tilt->axis_in_camera.transpose();
    information.topLeftCorner<3, 3>() =
        (Eigen::Matrix3d::Identity() - about) / (tilt->sigma_rad * tilt->sigma_rad) +
        diagonal[0] * about;
  }
  return information;
}

NormalEquations PriorEquations(const PosePriorFactor& prior, const Rigid3& cam_from_world) {
  NormalEquations out;
  out.information = prior.Information();
  out.gradient = out.information * Difference(cam_from_world, prior.cam_from_world);
  return out;
}

std::optional<Vector6d> SolveStep(const NormalEquations& equations, double max_rotation_rad) {
  Matrix6d damped = equations.information;
  damped.diagonal().array() += kDamping;
  const Vector6d descent = -equations.gradient;
  Vector6d step;
  if (!SolvePositive6(damped.data(), descent.data(), step.data())) return std::nullopt;
  if (!step.allFinite()) return std::nullopt;
  const double rotation = step.head<3>().norm();
  if (rotation > max_rotation_rad) step *= max_rotation_rad / rotation;
  return step;
}

}  // namespace plumb
