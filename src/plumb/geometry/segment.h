// Line segments in the image and in space. The order of the two end points carries no meaning.
#pragma once

#include <Eigen/Core>

namespace plumb {

/// A detected segment [px]. The centre of the image's first pixel is (0, 0).
struct Segment2 {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Detector's confidence in [0, 1]; comparable only between segments of one detector.
  double score = 1.0;

  Eigen::Vector2d Delta() const { return end - start; }
  double Length() const { return Delta().norm(); }
  Eigen::Vector2d Midpoint() const { return 0.5 * (start + end); }
};

/// A segment in space [m], in the frame that the variable's name states.
struct Segment3 {
  Eigen::Vector3d start = Eigen::Vector3d::Zero();
  Eigen::Vector3d end = Eigen::Vector3d::Zero();

  Eigen::Vector3d Delta() const { return end - start; }
  double Length() const { return Delta().norm(); }
  Eigen::Vector3d Midpoint() const { return 0.5 * (start + end); }
};

}  // namespace plumb
