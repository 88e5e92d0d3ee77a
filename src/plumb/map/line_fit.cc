#include "plumb/map/line_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

namespace plumb {
namespace {

constexpr double kDamping =
    1e-3;  // [1/m^2]: a standard deviation of 30 m, only against singularity
constexpr double kMinLength = 1e-6;  // [m]
constexpr double kMinExtent = 0.01;  // [m]
constexpr double kLowQuantile = 0.2;

// Distance [px] of a point x = (x, y, 1) on the plane z = 1 from the image of the line through a
// and b (camera frame), and its gradient by a and b.
struct PixelDistance {
  double value = 0.0;
  Eigen::RowVector3d by_a, by_b;
};

PixelDistance DistanceFromImage(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                const Eigen::Vector2d& focal, const Eigen::Vector3d& x) {
  const Eigen::Vector3d n = a.cross(b);
  // The image line is K^-T n; its first two coefficients scale the distance to pixels.
  const Eigen::Vector2d pixel_normal(n.x() / focal.x(), n.y() / focal.y());
  const double scale = std::max(pixel_normal.norm(), 1e-12);
  PixelDistance out;
  out.value = n.dot(x) / scale;
  const Eigen::Vector3d scale_by_n(pixel_normal.x() / focal.x() / scale,
                                   pixel_normal.y() / focal.y() / scale, 0.0);
  const Eigen::Vector3d q = (x - out.value * scale_by_n) / scale;
  out.by_a = b.cross(q).transpose();
  out.by_b = q.cross(a).transpose();
  return out;
}

double Quantile(std::vector<double>* values, double q) {
  std::sort(values->begin(), values->end());
  const double at = q * static_cast<double>(values->size() - 1);
  const size_t below = static_cast<size_t>(at);
  const size_t above = std::min(below + 1, values->size() - 1);
  return std::lerp((*values)[below], (*values)[above], at - static_cast<double>(below));
}

}  // namespace

std::optional<AnchoredLine> AnchoredLine::Create(const Segment3& anchors_in_world) {
  const Eigen::Vector3d delta = anchors_in_world.Delta();
  const double length = delta.norm();
  if (!(length > kMinLength) || !std::isfinite(length)) return std::nullopt;
  const Eigen::Vector3d direction = delta / length;
  Eigen::Index least = 0;
  direction.cwiseAbs().minCoeff(&least);
  const Eigen::Vector3d n1 = direction.cross(Eigen::Vector3d::Unit(least)).normalized();
  AnchoredLine line;
  line.anchors_in_world = anchors_in_world;
  line.across.row(0) = n1.transpose();
  line.across.row(1) = direction.cross(n1).transpose();
  return line;
}

AnchoredLine AnchoredLine::Moved(const Vector4d& delta) const {
  AnchoredLine moved = *this;
  moved.anchors_in_world.start += across.transpose() * delta.head<2>();
  moved.anchors_in_world.end += across.transpose() * delta.tail<2>();
  return moved;
}

LineResiduals EvaluateLine(const AnchoredLine& line, const LineObservation& observation,
                           double pixel_sigma_px) {
  LineResiduals out;
  const LineView& view = *observation.view;
  const Segment3& anchors = line.anchors_in_world;
  const Eigen::Matrix3d& rotation = view.cam_from_world_rotation;
  const Eigen::Vector3d a = rotation * anchors.start + view.cam_from_world_translation;
  const Eigen::Vector3d b = rotation * anchors.end + view.cam_from_world_translation;
  const Eigen::Matrix<double, 3, 2> across_in_cam = rotation * line.across.transpose();
  const Eigen::Vector2d* ends[2] = {&observation.start_normalized, &observation.end_normalized};
  for (int k = 0; k < 2; ++k) {
    const PixelDistance distance = DistanceFromImage(a, b, view.focal_px, ends[k]->homogeneous());
    out.value[k] = distance.value / pixel_sigma_px;
    out.jacobian.row(k).head<2>() = distance.by_a * across_in_cam / pixel_sigma_px;
    out.jacobian.row(k).tail<2>() = distance.by_b * across_in_cam / pixel_sigma_px;
  }

  const Eigen::Vector3d delta = anchors.Delta();
  const Eigen::Vector3d* points[2] = {&observation.lifted_in_world.start,
                                      &observation.lifted_in_world.end};
  for (int k = 0; k < 2; ++k) {
    // `across` may belong to the line before a move: remove what lies along the line first.
    const Eigen::Vector3d offset = *points[k] - anchors.start;
    const double along = offset.dot(delta) / delta.squaredNorm();  // 0 at start, 1 at end
    out.value.segment<2>(2 + 2 * k) =
        line.across * (offset - along * delta) / observation.depth_sigma_m;
    auto rows = out.jacobian.middleRows<2>(2 + 2 * k);
    rows.leftCols<2>() = -(1.0 - along) / observation.depth_sigma_m * Eigen::Matrix2d::Identity();
    rows.rightCols<2>() = -along / observation.depth_sigma_m * Eigen::Matrix2d::Identity();
  }
  return out;
}

void LineSystem::Add(const AnchoredLine& line, const LineObservation& observation,
                     const LineFitOptions& options) {
  const LineResiduals residuals = EvaluateLine(line, observation, options.pixel_sigma_px);
  Eigen::Matrix<double, 6, 1> weight =
      (1.0 + (residuals.value.array() / options.cauchy_scale).square()).inverse();
  if (!options.lifted_ends_count) weight.tail<4>().setZero();
  const Eigen::Matrix<double, 6, 4> weighted = weight.asDiagonal() * residuals.jacobian;
  information.noalias() += residuals.jacobian.transpose() * weighted;
  gradient.noalias() += weighted.transpose() * residuals.value;
}

Vector4d LineSystem::Step() const {
  const Matrix4d damped = information + kDamping * Matrix4d::Identity();
  return -damped.ldlt().solve(gradient);
}

FittedLine FittedLine::WithAnchors(double begin, double end) const {
  const Segment3& old = line.anchors_in_world;
  FittedLine moved = *this;
  moved.line.anchors_in_world = {old.start + begin * old.Delta(), old.start + end * old.Delta()};
  Matrix4d new_from_old;
  new_from_old << (1.0 - begin) * Eigen::Matrix2d::Identity(), begin * Eigen::Matrix2d::Identity(),
      (1.0 - end) * Eigen::Matrix2d::Identity(), end * Eigen::Matrix2d::Identity();
  moved.covariance = new_from_old * covariance * new_from_old.transpose();
  return moved;
}

Eigen::Matrix3d FittedLine::CovarianceOfStart() const {
  return line.across.transpose() * covariance.topLeftCorner<2, 2>() * line.across;
}

Eigen::Matrix3d FittedLine::CovarianceOfEnd() const {
  return line.across.transpose() * covariance.bottomRightCorner<2, 2>() * line.across;
}

std::optional<FittedLine> FitLine(const Segment3& initial_in_world,
                                  std::span<const LineObservation> observations,
                                  const LineFitOptions& options) {
  FittedLine fitted;
  Segment3 anchors = initial_in_world;
  for (int k = 0; k < options.iterations; ++k) {
    const std::optional<AnchoredLine> line = AnchoredLine::Create(anchors);
    if (!line) return std::nullopt;
    LineSystem system;
    for (const LineObservation& observation : observations) {
      system.Add(*line, observation, options);
    }
    fitted.line = line->Moved(system.Step());
    anchors = fitted.line.anchors_in_world;
    fitted.covariance = (system.information + kDamping * Matrix4d::Identity()).inverse();
  }
  if (!AnchoredLine::Create(anchors) || !fitted.covariance.allFinite()) return std::nullopt;
  return fitted;
}

std::pair<double, double> SupportedExtent(const Segment3& line_in_world,
                                          std::span<const LineObservation> observations) {
  const Eigen::Vector3d delta = line_in_world.Delta();
  const double square_length = delta.squaredNorm();
  std::vector<double> low, high;
  low.reserve(observations.size());
  high.reserve(observations.size());
  for (const LineObservation& observation : observations) {
    const Segment3& lifted = observation.lifted_in_world;
    const double a = (lifted.start - line_in_world.start).dot(delta) / square_length;
    const double b = (lifted.end - line_in_world.start).dot(delta) / square_length;
    low.push_back(std::min(a, b));
    high.push_back(std::max(a, b));
  }
  if (low.empty()) return {0.0, 1.0};
  const double begin = Quantile(&low, kLowQuantile), end = Quantile(&high, 1.0 - kLowQuantile);
  if (!((end - begin) * std::sqrt(square_length) > kMinExtent)) return {0.0, 1.0};
  return {begin, end};
}

}  // namespace plumb
