// The paper's midpoint distance between a detected segment and a projected 3D line.
#pragma once

#include <ceres/autodiff_cost_function.h>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/line_projection.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// PtLine eq. 6: difference of the midpoints of the projected and of the detected segment.
///
///   r = ( (h(A) + h(B)) / 2 - midpoint ) * weight      2 residuals [px]
///
/// A, B: end points of the 3D line under (q, t). Biased along the line when a detection is a
/// fragment; docs/method/association.md. Parameter blocks as in OverlapDistanceCost. Evaluation
/// fails when an end point is nearer than kNearPlane.
class MidpointDistanceCost {
 public:
  static ceres::CostFunction* Create(const Camera& camera, const Segment3& line_in_world,
                                     const Segment2& segment_px, double weight) {
    return new ceres::AutoDiffCostFunction<MidpointDistanceCost, 2, 4, 3>(
        new MidpointDistanceCost(camera, line_in_world, segment_px.Midpoint(), weight));
  }

  template <typename T>
  bool operator()(const T* const q_xyzw, const T* const t, T* residuals) const {
    using Vector3 = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q_xyzw);
    const Eigen::Map<const Vector3> translation(t);
    const Vector3 a = rotation * line_.start.cast<T>() + translation;
    const Vector3 b = rotation * line_.end.cast<T>() + translation;
    if (!(a.z() > kNearPlane) || !(b.z() > kNearPlane)) return false;
    const T x = 0.5 * (a.x() / a.z() + b.x() / b.z());
    const T y = 0.5 * (a.y() / a.z() + b.y() / b.z());
    residuals[0] = (camera_.fx * x + camera_.cx - midpoint_.x()) * weight_;
    residuals[1] = (camera_.fy * y + camera_.cy - midpoint_.y()) * weight_;
    return true;
  }

 private:
  MidpointDistanceCost(const Camera& camera, const Segment3& line, const Eigen::Vector2d& midpoint,
                       double weight)
      : camera_(camera), line_(line), midpoint_(midpoint), weight_(weight) {}

  const Camera camera_;
  const Segment3 line_;
  const Eigen::Vector2d midpoint_;
  const double weight_;
};

}  // namespace plumb
