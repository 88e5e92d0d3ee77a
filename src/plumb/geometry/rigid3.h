// Rigid transforms and the rotation group.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace plumb {

/// Tangent vector of a pose: (rotation w [rad], translation v [m]).
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Rigid transform. A variable named `b_from_a` maps coordinates: x_in_b = b_from_a * x_in_a.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return rotation * x + translation; }
  Rigid3 operator*(const Rigid3& b) const {
    return {(rotation * b.rotation).normalized(), rotation * b.translation + translation};
  }
  Rigid3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {inverse, -(inverse * translation)};
  }
  /// For cam_from_world: the camera centre in the world.
  Eigen::Vector3d Center() const { return -(rotation.conjugate() * translation); }
  Eigen::Matrix3d RotationMatrix() const { return rotation.toRotationMatrix(); }
  bool IsFinite() const { return rotation.coeffs().allFinite() && translation.allFinite(); }
};

/// [w]_x, so that Hat(w) * x = w x x.
Eigen::Matrix3d Hat(const Eigen::Vector3d& w);

/// Rotation by |w| [rad] about w. Exact at w = 0.
Eigen::Quaterniond ExpSo3(const Eigen::Vector3d& w);

/// Rotation vector of `rotation` (unit), |w| <= pi. Inverse of ExpSo3.
Eigen::Vector3d LogSo3(const Eigen::Quaterniond& rotation);

/// Left perturbation of `cam_from_world`: x_c' = exp(w) x_c + v for delta = (w, v).
Rigid3 Perturb(const Rigid3& cam_from_world, const Vector6d& delta);

/// The delta that Perturb() needs to turn `from` into `to`. Inverse of Perturb.
Vector6d Difference(const Rigid3& to, const Rigid3& from);

/// Distance of the camera centres [m] and angle between the rotations [rad] of two cam_from_world.
struct PoseDistance {
  double position_m = 0.0;
  double rotation_rad = 0.0;
};
PoseDistance DistanceBetween(const Rigid3& a_from_world, const Rigid3& b_from_world);

}  // namespace plumb
