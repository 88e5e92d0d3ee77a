// Distortion-free pinhole camera. A camera with a lens is an ImageCamera (rectifier.h).
#pragma once

#include <cmath>

#include <Eigen/Core>

namespace plumb {

/// Pinhole intrinsics [px]; the centre of the first pixel is (0, 0). Camera axes: x right, y down,
/// z forward. fx and fy are non-zero; a negative value mirrors the axis (some data sets have it).
struct Camera {
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  int width_px = 0, height_px = 0;

  friend bool operator==(const Camera&, const Camera&) = default;
  double MeanFocal() const { return 0.5 * (std::abs(fx) + std::abs(fy)); }
  bool IsValid() const {
    return std::isfinite(fx) && std::isfinite(fy) && std::isfinite(cx) && std::isfinite(cy) &&
           fx != 0.0 && fy != 0.0 && width_px > 0 && height_px > 0;
  }
  /// @param x_in_cam  (3,) [m], z > 0.  @return pixel coordinates.
  Eigen::Vector2d Project(const Eigen::Vector3d& x_in_cam) const {
    return {fx * x_in_cam.x() / x_in_cam.z() + cx, fy * x_in_cam.y() / x_in_cam.z() + cy};
  }
  /// @return coordinates on the plane z = 1.
  Eigen::Vector2d Normalize(const Eigen::Vector2d& px) const {
    return {(px.x() - cx) / fx, (px.y() - cy) / fy};
  }
  bool Contains(const Eigen::Vector2d& px, double margin_px = 0.0) const {
    return px.x() >= -margin_px && px.x() <= width_px - 1 + margin_px && px.y() >= -margin_px &&
           px.y() <= height_px - 1 + margin_px;
  }
};

}  // namespace plumb
