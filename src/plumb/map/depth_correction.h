// The systematic error of a depth sensor, found from what the key frames' views say of the same
// places.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/map/depth_view.h"

namespace plumb {

/// A place of a key frame whose depth its depth image and other views give.
struct DepthSample {
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();  // (x / z, y / z) in the camera frame
  double sensor = 0.0;                            // inverse depth [1/m], > 0
  double views = 0.0;                             // the same by triangulation, > 0
  double views_sigma = 0.0;                       // its standard deviation [1/m], > 0
  uint32_t key_frame = 0;
};

/// w -> w + shift . (x, y, 1) + scale . (x, y, 1) w for an inverse depth w [1/m] on the ray
/// (x, y, 1): offset and scale of a sensor's disparity, each with a tilt over the image. Covers a
/// depth camera whose focal length, baseline or pose beside the colour camera is slightly off, and
/// poses whose scale is off the depth's by a few percent. Never below 0.01 / m.
struct DepthCorrection {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  // [1/m]
  Eigen::Vector3d scale = Eigen::Vector3d::Zero();

  double operator()(const Eigen::Vector2d& ray, double inverse_depth) const {
    const Eigen::Vector3d place = ray.homogeneous();
    return std::max(inverse_depth + shift.dot(place) + scale.dot(place) * inverse_depth, 0.01);
  }
};

struct DepthFit {
  DepthCorrection correction;
  /// Of the corrected depths' standard deviation over what the DepthNoise says.
  double noise_factor = 1.0;
  double median_change = 0.0;  // |corrected / given - 1| of the samples' depths
};

/// Fits the correction robustly (Cauchy). It is kept only if, fitted to one half of the key frames,
/// it explains the other half better than chance would, both ways. The noise is measured either
/// way.
/// @param samples  Of one sensor, ascending by key frame.
/// @return nullopt when a half has fewer than 100 samples: nothing is known then.
std::optional<DepthFit> FitDepthCorrection(std::span<const DepthSample> samples,
                                           const DepthNoise& noise = {});

}  // namespace plumb
