// What one view says about a 3D line, as a function of both the camera's intrinsics and the line.
#pragma once

#include <ceres/autodiff_cost_function.h>

#include <Eigen/Core>

#include "plumb/refine/cost/line_in_view.h"

namespace plumb {

/// Changes of a camera: of the logarithm of both focal lengths, of the principal point over the
/// focal lengths, of the first two radial coefficients.
inline constexpr int kNumCameraChanges = 5;

/// Where a pixel lies on the plane z = 1, linear in the changes of the camera.
struct LinearRay {
  Eigen::Vector2d normalized = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, kNumCameraChanges> by_camera =
      Eigen::Matrix<double, 2, kNumCameraChanges>::Zero();
};

/// Perpendicular distances of a segment's ends, undistorted by the changed camera, to the projected
/// infinite line:
///
///   r = [ d(l, p_start), d(l, p_end) ] / sigma      2 residuals, unitless
///
/// Parameter blocks: changes (5) of the camera; delta (4) of the line. The pose is fixed.
/// Evaluation fails when the line has no image (kMinRaySine).
class LineInCameraCost {
 public:
  /// @param line_in_cam  Its anchors and directions in the camera's frame.
  /// @param focal_px     (fx, fy), may be negative.
  /// @param sigma_px     > 0.
  static ceres::CostFunction* Create(const AnchoredSegment& line_in_cam,
                                     const Eigen::Vector2d& focal_px, const LinearRay& start,
                                     const LinearRay& end, double sigma_px) {
    return new ceres::AutoDiffCostFunction<LineInCameraCost, 2, kNumCameraChanges, 4>(
        new LineInCameraCost(line_in_cam, focal_px, start, end, sigma_px));
  }

  template <typename T>
  bool operator()(const T* changes, const T* delta, T* residuals) const {
    Eigen::Matrix<T, 3, 1> a, b;
    line_.Place(delta, &a, &b);
    const Eigen::Map<const Eigen::Matrix<T, kNumCameraChanges, 1>> change(changes);
    const auto changed = [&change](const LinearRay& ray) -> Eigen::Matrix<T, 2, 1> {
      return ray.normalized.template cast<T>() + ray.by_camera.template cast<T>() * change;
    };
    return DistancesFromLine<T>(a, b, changed(start_), changed(end_), focal_px_, sigma_px_,
                                residuals);
  }

 private:
  LineInCameraCost(const AnchoredSegment& line, const Eigen::Vector2d& focal_px,
                   const LinearRay& start, const LinearRay& end, double sigma_px)
      : line_(line), focal_px_(focal_px), start_(start), end_(end), sigma_px_(sigma_px) {}

  const AnchoredSegment line_;
  const Eigen::Vector2d focal_px_;
  const LinearRay start_, end_;
  const double sigma_px_;
};

}  // namespace plumb
