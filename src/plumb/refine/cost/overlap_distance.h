// Distance of an observed part of a segment to the image of its 3D line.
#pragma once

#include <ceres/autodiff_cost_function.h>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/line_projection.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// Perpendicular distances of both ends of the overlap to the projected infinite line:
///
///   r = [ d(l, p_start), d(l, p_end) ] * root_information      2 residuals, unitless
///
/// l: image of the 3D line under (q, t); d: signed distance [px].
/// Parameter blocks: q (4) cam_from_world rotation, xyzw; t (3) cam_from_world translation [m].
/// Evaluation fails, so that LM rejects the step, when the line has no image (kMinRaySine).
class OverlapDistanceCost {
 public:
  static ceres::CostFunction* Create(const Camera& camera, const Segment3& line_in_world,
                                     const Segment2& part_px, double root_information) {
    return new ceres::AutoDiffCostFunction<OverlapDistanceCost, 2, 4, 3>(
        new OverlapDistanceCost(camera, line_in_world, part_px, root_information));
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
    const T l2 = n.z() - camera_.cx * l0 - camera_.cy * l1;
    const T scale = T(root_information_) / sqrt(l0 * l0 + l1 * l1);
    residuals[0] = (l0 * part_.start.x() + l1 * part_.start.y() + l2) * scale;
    residuals[1] = (l0 * part_.end.x() + l1 * part_.end.y() + l2) * scale;
    return true;
  }

 private:
  OverlapDistanceCost(const Camera& camera, const Segment3& line, const Segment2& part,
                      double root_information)
      : camera_(camera), line_(line), part_(part), root_information_(root_information) {}

  const Camera camera_;
  const Segment3 line_;
  const Segment2 part_;
  const double root_information_;
};

}  // namespace plumb
