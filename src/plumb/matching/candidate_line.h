// A 3D line that a frame's segments may match, and its projection.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// A map line selected for one frame.
struct CandidateLine {
  Segment3 segment_in_world;
  double weight = 1.0;  // stability, > 0
  /// Covariance of the two end points [m^2].
  Eigen::Matrix3d covariance_start = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d covariance_end = Eigen::Matrix3d::Zero();
  uint32_t id = 0;  // the caller's name for it
};

/// Visible parts of candidate lines in the image, as parallel arrays of equal length.
struct ProjectedLines {
  std::vector<uint32_t> line;                   // index into the candidates
  std::vector<float> x, y;                      // start [px]
  std::vector<float> direction_x, direction_y;  // unit
  std::vector<float> length;                    // [px]
  std::vector<float> angle;                     // of the direction, [0, pi)
  std::vector<float> weight;
  /// The whole lines' ends in the camera [m]; only ProjectTable() fills them.
  std::vector<float> start_x, start_y, start_z, end_x, end_y, end_z;

  size_t size() const { return line.size(); }
  void Clear();
  void Reserve(size_t count);
  void Resize(size_t count);
};

/// Projections shorter than this are not compared with segments [px].
inline constexpr double kMinVisiblePx = 10.0;

/// Projects the candidates, clipped to the near plane and the image, and keeps those of which more
/// than `min_length_px` is visible, in their order. No allocation once `out` has the capacity.
void ProjectCandidates(const Camera& camera, const Rigid3& cam_from_world,
                       std::span<const CandidateLine> lines, double min_length_px,
                       ProjectedLines* out);

/// Variance [px^2] across the projected line that the line's own covariance causes: the larger one
/// of its two end points, with depths below 0.2 m taken as 0.2 m.
double MapVariancePx(const Camera& camera, const Rigid3& cam_from_world, const CandidateLine& line);

}  // namespace plumb
