// Reprojection error of a 3D point, whitened by pixel noise and depth uncertainty.
#pragma once

#include <ceres/autodiff_cost_function.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/line_projection.h"

namespace plumb {

/// PtLine eq. 9, whitened: r = L (h(q, t, P) - p), 2 residuals. L = weight I gives the paper's own;
/// FromCovariance() turns a residual covariance [px^2] into L. Parameter blocks as in
/// OverlapDistanceCost. Evaluation fails when the point is nearer than kNearPlane.
class PointReprojectionCost {
 public:
  /// @param covariance  Positive definite [px^2].
  static Eigen::Matrix2d FromCovariance(const Eigen::Matrix2d& covariance) {
    return covariance.llt().matrixL().solve(Eigen::Matrix2d::Identity());
  }

  static ceres::CostFunction* Create(const Camera& camera, const Eigen::Vector3d& point_in_world,
                                     const Eigen::Vector2d& pixel,
                                     const Eigen::Matrix2d& root_information) {
    return new ceres::AutoDiffCostFunction<PointReprojectionCost, 2, 4, 3>(
        new PointReprojectionCost(camera, point_in_world, pixel, root_information));
  }

  template <typename T>
  bool operator()(const T* const q_xyzw, const T* const t, T* residuals) const {
    using Vector3 = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q_xyzw);
    const Eigen::Map<const Vector3> translation(t);
    const Vector3 x = rotation * point_.cast<T>() + translation;
    if (!(x.z() > kNearPlane)) return false;
    const T du = camera_.fx * x.x() / x.z() + camera_.cx - pixel_.x();
    const T dv = camera_.fy * x.y() / x.z() + camera_.cy - pixel_.y();
    residuals[0] = root_information_(0, 0) * du + root_information_(0, 1) * dv;
    residuals[1] = root_information_(1, 0) * du + root_information_(1, 1) * dv;
    return true;
  }

 private:
  PointReprojectionCost(const Camera& camera, const Eigen::Vector3d& point,
                        const Eigen::Vector2d& pixel, const Eigen::Matrix2d& root_information)
      : camera_(camera), point_(point), pixel_(pixel), root_information_(root_information) {}

  const Camera camera_;
  const Eigen::Vector3d point_;
  const Eigen::Vector2d pixel_;
  const Eigen::Matrix2d root_information_;
};

}  // namespace plumb
