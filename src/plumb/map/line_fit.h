// Least-squares fit of one 3D line to its observations in several views.
#pragma once

#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>

#include "plumb/geometry/segment.h"

namespace plumb {

/// A view as the fit needs it.
struct LineView {
  Eigen::Matrix3d cam_from_world_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d cam_from_world_translation = Eigen::Vector3d::Zero();
  Eigen::Vector2d focal_px = Eigen::Vector2d::Ones();  // (fx, fy), may be negative
};

/// One segment seen in one view, and where its own depth put its end points.
struct LineObservation {
  const LineView* view = nullptr;                              // borrowed
  Eigen::Vector2d start_normalized = Eigen::Vector2d::Zero();  // on the plane z = 1
  Eigen::Vector2d end_normalized = Eigen::Vector2d::Zero();
  Segment3 lifted_in_world;
  double depth_sigma_m = 0.0;  // of the lifted end points, > 0
};

struct LineFitOptions {
  double pixel_sigma_px = 0.7;  // of a detected end point across the segment
  double cauchy_scale = 2.0;    // in standard deviations
  int iterations = 4;
  /// False: lifted end points are no measurements, since they come from the segments themselves.
  bool lifted_ends_count = true;
};

using Matrix4d = Eigen::Matrix<double, 4, 4>;
using Vector4d = Eigen::Matrix<double, 4, 1>;

/// A line as two anchor points, each free in the plane across the line: 4 degrees of freedom,
/// minimal, no constraint. delta = (start along n1, n2, end along n1, n2) [m].
struct AnchoredLine {
  Segment3 anchors_in_world;
  Eigen::Matrix<double, 2, 3> across = Eigen::Matrix<double, 2, 3>::Zero();  // rows n1, n2

  /// @return nullopt when the anchors coincide or are not finite.
  static std::optional<AnchoredLine> Create(const Segment3& anchors_in_world);
  AnchoredLine Moved(const Vector4d& delta) const;  // `across` is kept
};

/// Residuals of one observation, in standard deviations: distance of its 2D start and end from the
/// projected line, then offset across the line (n1, n2) of its lifted start and end.
struct LineResiduals {
  Eigen::Matrix<double, 6, 1> value;
  Eigen::Matrix<double, 6, 4> jacobian;  // by AnchoredLine's delta, at delta = 0
};
LineResiduals EvaluateLine(const AnchoredLine& line, const LineObservation& observation,
                           double pixel_sigma_px);

/// Robustly weighted normal equations of some observations.
struct LineSystem {
  Matrix4d information = Matrix4d::Zero();
  Vector4d gradient = Vector4d::Zero();

  void Add(const AnchoredLine& line, const LineObservation& observation,
           const LineFitOptions& options);
  /// The Gauss-Newton step, minutely damped.
  Vector4d Step() const;
};

struct FittedLine {
  AnchoredLine line;
  Matrix4d covariance = Matrix4d::Zero();  // of AnchoredLine's delta [m^2]

  /// The same line between the points (1 - a) * start + a * end, a = begin and a = end.
  FittedLine WithAnchors(double begin, double end) const;
  /// 3x3 covariances [m^2] of the anchors, rank 2.
  Eigen::Matrix3d CovarianceOfStart() const;
  Eigen::Matrix3d CovarianceOfEnd() const;
};

/// Gauss-Newton from `initial_in_world` with Cauchy weights.
/// @param observations  At least one.
/// @return nullopt when the line degenerates to a point or the numbers overflow.
/// Source: docs/method/association.md.
std::optional<FittedLine> FitLine(const Segment3& initial_in_world,
                                  std::span<const LineObservation> observations,
                                  const LineFitOptions& options = {});

/// Part of the line that the observations support: from the 20 % quantile of their lower ends to
/// the 80 % quantile of their upper ends, as factors a of (1 - a) * start + a * end. (0, 1) when
/// that leaves less than 1 cm.
std::pair<double, double> SupportedExtent(const Segment3& line_in_world,
                                          std::span<const LineObservation> observations);

}  // namespace plumb
