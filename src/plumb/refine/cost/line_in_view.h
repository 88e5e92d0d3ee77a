// What one view says about a 3D line, as a function of both the view's pose and the line.
#pragma once

#include <ceres/autodiff_cost_function.h>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/line_projection.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// A line as two anchors, each free in the plane across the line (map/line_fit's coordinates):
/// delta = (start along n1, n2, end along n1, n2) [m]. Minimal, so that no manifold is needed.
struct AnchoredSegment {
  Segment3 anchors_in_world;
  Eigen::Matrix<double, 3, 2> across;  // columns n1, n2

  template <typename T>
  void Place(const T* delta, Eigen::Matrix<T, 3, 1>* start, Eigen::Matrix<T, 3, 1>* end) const {
    const Eigen::Matrix<T, 3, 1> n1 = across.col(0).cast<T>(), n2 = across.col(1).cast<T>();
    *start = anchors_in_world.start.cast<T>() + n1 * delta[0] + n2 * delta[1];
    *end = anchors_in_world.end.cast<T>() + n1 * delta[2] + n2 * delta[3];
  }
};

/// @param line  Of positive length.
inline AnchoredSegment AnchorOf(const Segment3& line) {
  const Eigen::Vector3d direction = line.Delta().normalized();
  Eigen::Index least = 0;
  direction.cwiseAbs().minCoeff(&least);
  AnchoredSegment anchored{line, {}};
  anchored.across.col(0) = direction.cross(Eigen::Vector3d::Unit(least)).normalized();
  anchored.across.col(1) = direction.cross(anchored.across.col(0));
  return anchored;
}

/// Perpendicular distances of two points of the plane z = 1 to the image of the infinite line
/// through a and b (camera frame), in pixels over `sigma_px`. @return false when the line has no
/// image (kMinRaySine).
template <typename T>
bool DistancesFromLine(const Eigen::Matrix<T, 3, 1>& a, const Eigen::Matrix<T, 3, 1>& b,
                       const Eigen::Matrix<T, 2, 1>& start, const Eigen::Matrix<T, 2, 1>& end,
                       const Eigen::Vector2d& focal_px, double sigma_px, T* distances) {
  using std::sqrt;
  const Eigen::Matrix<T, 3, 1> n = a.cross(b);
  const T min_square = kMinRaySine * kMinRaySine * a.squaredNorm() * b.squaredNorm();
  if (!(n.template head<2>().squaredNorm() > min_square)) return false;
  const T l0 = n.x() / focal_px.x(), l1 = n.y() / focal_px.y();
  const T scale = T(1.0 / sigma_px) / sqrt(l0 * l0 + l1 * l1);
  distances[0] = (n.x() * start.x() + n.y() * start.y() + n.z()) * scale;
  distances[1] = (n.x() * end.x() + n.y() * end.y() + n.z()) * scale;
  return true;
}

/// Perpendicular distances of a segment's ends to the projected infinite line:
///
///   r = [ d(l, p_start), d(l, p_end) ] / sigma      2 residuals, unitless
///
/// Parameter blocks: q (4) cam_from_world rotation, xyzw; t (3) cam_from_world translation [m];
/// delta (4) of the line. Evaluation fails when the line has no image (kMinRaySine).
class LineInViewCost {
 public:
  /// @param focal_px                  (fx, fy), may be negative.
  /// @param segment_normalized        On the plane z = 1.
  /// @param sigma_px                  > 0.
  static ceres::CostFunction* Create(const AnchoredSegment& line, const Eigen::Vector2d& focal_px,
                                     const Segment2& segment_normalized, double sigma_px) {
    return new ceres::AutoDiffCostFunction<LineInViewCost, 2, 4, 3, 4>(
        new LineInViewCost(line, focal_px, segment_normalized, sigma_px));
  }

  template <typename T>
  bool operator()(const T* q_xyzw, const T* t, const T* delta, T* residuals) const {
    using Vector2 = Eigen::Matrix<T, 2, 1>;
    using Vector3 = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q_xyzw);
    const Eigen::Map<const Vector3> translation(t);
    Vector3 start, end;
    line_.Place(delta, &start, &end);
    const Vector3 a = rotation * start + translation;
    const Vector3 b = rotation * end + translation;
    return DistancesFromLine<T>(a, b, Vector2(segment_.start.cast<T>()),
                                Vector2(segment_.end.cast<T>()), focal_px_, sigma_px_, residuals);
  }

 private:
  LineInViewCost(const AnchoredSegment& line, const Eigen::Vector2d& focal_px,
                 const Segment2& segment, double sigma_px)
      : line_(line), focal_px_(focal_px), segment_(segment), sigma_px_(sigma_px) {}

  const AnchoredSegment line_;
  const Eigen::Vector2d focal_px_;
  const Segment2 segment_;
  const double sigma_px_;
};

/// Offset of one end point, where the view's own depth puts it, across the line; 3 residuals of
/// rank 2: (I - d d^T) (x - a) / sigma in the camera frame. Parameter blocks as of LineInViewCost.
class LiftedPointCost {
 public:
  static ceres::CostFunction* Create(const AnchoredSegment& line,
                                     const Eigen::Vector3d& point_in_cam, double sigma_m) {
    return new ceres::AutoDiffCostFunction<LiftedPointCost, 3, 4, 3, 4>(
        new LiftedPointCost(line, point_in_cam, sigma_m));
  }

  template <typename T>
  bool operator()(const T* q_xyzw, const T* t, const T* delta, T* residuals) const {
    using Vector3 = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q_xyzw);
    const Eigen::Map<const Vector3> translation(t);
    Vector3 start, end;
    line_.Place(delta, &start, &end);
    const Vector3 along = rotation * (end - start);
    const Vector3 offset = point_in_cam_.cast<T>() - (rotation * start + translation);
    const T square = along.squaredNorm();
    if (!(square > 0.0)) return false;
    const T share = offset.dot(along) / square;
    Eigen::Map<Vector3> out(residuals);
    out = (offset - share * along) * T(1.0 / sigma_m_);
    return true;
  }

 private:
  LiftedPointCost(const AnchoredSegment& line, const Eigen::Vector3d& point_in_cam, double sigma_m)
      : line_(line), point_in_cam_(point_in_cam), sigma_m_(sigma_m) {}

  const AnchoredSegment line_;
  const Eigen::Vector3d point_in_cam_;
  const double sigma_m_;
};

}  // namespace plumb
