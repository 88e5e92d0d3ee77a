// Epipolar geometry of two posed pinhole cameras, and the overlap of segments that it predicts.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// The epipolar lines, in image `b`, of the two end points of a segment of image `a`. Homogeneous,
/// scaled so that the distance of a point is in pixels.
struct EpipolarBand {
  Eigen::Vector3d start = Eigen::Vector3d::Zero();
  Eigen::Vector3d end = Eigen::Vector3d::Zero();
};

/// Maps image `a` to epipolar lines of image `b`.
class EpipolarGeometry {
 public:
  /// F = K_b^-T [t]_x R K_a^-1 with (R, t) = b_from_a, scaled to unit Frobenius norm, so that
  /// x_b^T F x_a = 0 for the images of one point. fx and fy may be negative.
  /// @return nullopt when the centres coincide (a pure rotation has no epipolar geometry), a camera
  ///         is invalid or a pose is not finite.
  /// Source: PtLine eq. 2; Hartley & Zisserman, 2nd ed., Sec. 9.2.
  static std::optional<EpipolarGeometry> Create(const Camera& camera_a, const Rigid3& a_from_world,
                                                const Camera& camera_b, const Rigid3& b_from_world);

  const Eigen::Matrix3d& b_from_a_fundamental() const { return fundamental_; }

  /// @return nullopt when `a` says nothing about image `b`: it has no length, or the epipole lies
  ///         within 2 px of it (then its band covers everything).
  std::optional<EpipolarBand> BandOf(const Segment2& a) const;

  /// True when the epipole of image `b` lies within 2 px of `b`: every band then crosses it.
  bool EpipoleTouches(const Segment2& b) const;

 private:
  Eigen::Matrix3d fundamental_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d epipole_a_ = Eigen::Vector3d::Zero();  // homogeneous, F * epipole_a = 0
  Eigen::Vector3d epipole_b_ = Eigen::Vector3d::Zero();  // homogeneous, F^T * epipole_b = 0
};

/// Mutual overlap of `b` with the part of its line that the band cuts out (PtLine eq. 3 and 4):
/// inner over outer length of the four collinear points, 0..1; 0 when outer < 1 px.
/// @return nullopt when `b` has no length or an epipolar line is (nearly) parallel to it.
/// Source: mutual overlap as in Line3D++; the guards are ours.
std::optional<double> BandOverlap(const EpipolarBand& band, const Segment2& b);

}  // namespace plumb
