#include "plumb/geometry/rigid3.h"

#include <cmath>

namespace plumb {

Eigen::Matrix3d Hat(const Eigen::Vector3d& w) {
  Eigen::Matrix3d m;
  m << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return m;
}

Eigen::Quaterniond ExpSo3(const Eigen::Vector3d& w) {
  const double angle_squared = w.squaredNorm();
  const double angle = std::sqrt(angle_squared);
  // sin(a/2)/a, by its series where the quotient would lose digits.
  const double k = angle < 1e-4 ? 0.5 - angle_squared / 48.0 : std::sin(0.5 * angle) / angle;
  return Eigen::Quaterniond(std::cos(0.5 * angle), k * w.x(), k * w.y(), k * w.z()).normalized();
}

Eigen::Vector3d LogSo3(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * rotation.vec();
  const double sine = v.norm();
  const double cosine = sign * rotation.w();
  if (sine < 1e-9) return 2.0 / cosine * v;
  return 2.0 * std::atan2(sine, cosine) / sine * v;
}

Rigid3 Perturb(const Rigid3& cam_from_world, const Vector6d& delta) {
  const Eigen::Quaterniond turn = ExpSo3(delta.head<3>());
  return {(turn * cam_from_world.rotation).normalized(),
          turn * cam_from_world.translation + delta.tail<3>()};
}

Vector6d Difference(const Rigid3& to, const Rigid3& from) {
  const Eigen::Quaterniond turn = to.rotation * from.rotation.conjugate();
  Vector6d delta;
  delta << LogSo3(turn), to.translation - turn * from.translation;
  return delta;
}

PoseDistance DistanceBetween(const Rigid3& a_from_world, const Rigid3& b_from_world) {
  return {(a_from_world.Center() - b_from_world.Center()).norm(),
          LogSo3(a_from_world.rotation * b_from_world.rotation.conjugate()).norm()};
}

}  // namespace plumb
