// Gaussian prior on a pose.
#pragma once

#include <ceres/autodiff_cost_function.h>
#include <ceres/rotation.h>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/rigid3.h"

namespace plumb {

/// Left difference to the prior pose over its uncertainty, 6 residuals:
///
///   r = [ log(q q0^-1) / rotation_sigma,  (t - q q0^-1 t0) / position_sigma ]
///
/// Parameter blocks as in OverlapDistanceCost.
class PosePriorCost {
 public:
  /// @param rotation_sigma_rad, position_sigma_m  > 0.
  static ceres::CostFunction* Create(const Rigid3& cam_from_world, double rotation_sigma_rad,
                                     double position_sigma_m) {
    return new ceres::AutoDiffCostFunction<PosePriorCost, 6, 4, 3>(
        new PosePriorCost(cam_from_world, rotation_sigma_rad, position_sigma_m));
  }

  template <typename T>
  bool operator()(const T* const q_xyzw, const T* const t, T* residuals) const {
    using Vector3 = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q_xyzw);
    const Eigen::Map<const Vector3> translation(t);
    const Eigen::Quaternion<T> turn = rotation * prior_.rotation.conjugate().cast<T>();
    const T q_wxyz[4] = {turn.w(), turn.x(), turn.y(), turn.z()};
    T angle_axis[3];
    ceres::QuaternionToAngleAxis(q_wxyz, angle_axis);
    const Vector3 shift = translation - turn * prior_.translation.cast<T>();
    for (int i = 0; i < 3; ++i) {
      residuals[i] = angle_axis[i] / rotation_sigma_rad_;
      residuals[3 + i] = shift[i] / position_sigma_m_;
    }
    return true;
  }

 private:
  PosePriorCost(const Rigid3& prior, double rotation_sigma_rad, double position_sigma_m)
      : prior_(prior),
        rotation_sigma_rad_(rotation_sigma_rad),
        position_sigma_m_(position_sigma_m) {}

  const Rigid3 prior_;
  const double rotation_sigma_rad_;
  const double position_sigma_m_;
};

}  // namespace plumb
