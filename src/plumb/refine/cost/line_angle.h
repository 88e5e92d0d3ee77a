// The paper's angle between a detected segment and a projected 3D line.
#pragma once

#include <ceres/autodiff_cost_function.h>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/line_projection.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// PtLine eq. 7: s sin(angle between the image lines), signed.
///
///   r = scale_px * (A B' - B A') / (|(A, B)| |(A', B')|)      1 residual [px]
///
/// (A, B): the detected segment's line; (A', B'): the projected one under (q, t). The scale s, the
/// projected length, is a constant here: differentiating it rewards shrinking projections. The sine
/// keeps its sign, because |sin| has a kink at the optimum. Parameter blocks as in
/// OverlapDistanceCost. Evaluation fails when the line has no image.
class LineAngleCost {
 public:
  /// @param segment_px  Must have a length.
  static ceres::CostFunction* Create(const Camera& camera, const Segment3& line_in_world,
                                     const Segment2& segment_px, double scale_px) {
    return new ceres::AutoDiffCostFunction<LineAngleCost, 1, 4, 3>(
        new LineAngleCost(camera, line_in_world, segment_px.Delta().normalized(), scale_px));
  }

  template <typename T>
  bool operator()(const T* const q_xyzw, const T* const t, T* residuals) const {
    using std::sqrt;
    using Vector3 = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q_xyzw);
    const Eigen::Map<const Vector3> translation(t);
    const Vector3 a = rotation * line_.start.cast<T>() + translation;
    const Vector3 b = rotation * line_.end.cast<T>() + translation;
    const Vector3 n = a.cross(b);
    const T min_square = kMinRaySine * kMinRaySine * a.squaredNorm() * b.squaredNorm();
    if (!(n.template head<2>().squaredNorm() > min_square)) return false;
    const T l0 = n.x() / camera_.fx;
    const T l1 = n.y() / camera_.fy;
    // The detected line's normal is (-d_y, d_x): the sine is the normal's part along the direction.
    residuals[0] =
        scale_px_ * (l0 * direction_.x() + l1 * direction_.y()) / sqrt(l0 * l0 + l1 * l1);
    return true;
  }

 private:
  LineAngleCost(const Camera& camera, const Segment3& line, const Eigen::Vector2d& direction,
                double scale_px)
      : camera_(camera), line_(line), direction_(direction), scale_px_(scale_px) {}

  const Camera camera_;
  const Segment3 line_;
  const Eigen::Vector2d direction_;
  const double scale_px_;
};

}  // namespace plumb
