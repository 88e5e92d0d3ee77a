// 3D lines with bounding spheres: which of them does a camera see, and where?
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// The visible part of a line in an image.
struct ProjectedLine {
  uint32_t line = 0;
  Segment2 segment_px;
};

/// Grows and changes while a map is built. Nothing here knows about occlusion.
class LineCloud {
 public:
  size_t size() const { return lines_.size(); }
  const Segment3& operator[](size_t line) const { return lines_[line]; }

  void Add(const Segment3& line_in_world);
  void Set(size_t line, const Segment3& line_in_world);

  /// Lines whose part inside the image is longer than `min_length_px`, ascending, into
  /// `out_projected` (cleared first).
  /// @param max_depth_m  Lines that are wholly farther away are left out.
  void Project(const Camera& camera, const Rigid3& cam_from_world, double min_length_px,
               double max_depth_m, std::vector<ProjectedLine>* out_projected) const;

 private:
  struct Sphere {
    Eigen::Vector3d center;
    double radius_m;
  };
  static Sphere Bound(const Segment3& line);

  std::vector<Segment3> lines_;
  std::vector<Sphere> spheres_;  // first test, cheaper than a projection
};

}  // namespace plumb
