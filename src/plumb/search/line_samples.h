// Points along 3D lines, as the search looks them up in the direction field.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/search/search_line.h"

namespace plumb {

/// Parallel arrays in the camera frame of the pose they were sampled for, which keeps single
/// precision exact enough anywhere in the world. Padded with samples of weight 0 to a multiple of
/// kLanes.
struct LineSamples {
  static constexpr size_t kLanes = 8;

  std::vector<float> x, y, z;                                // [m]
  std::vector<float> direction_x, direction_y, direction_z;  // unit, along the line
  std::vector<float> weight;                                 // sums to 1
  size_t count = 0;                                          // without the padding

  size_t padded_size() const { return weight.size(); }
};

/// One sample per 40 px of a line as seen from `cam_from_world`, 1 to 4 a line, spread evenly in
/// space. A line's samples share its weight times its length, at most 160 px. Lines without image
/// are left out. No allocation once `out` has the capacity.
/// Source: docs/method/association.md.
void SampleLines(const Camera& camera, const Rigid3& cam_from_world,
                 std::span<const SearchLine> lines, LineSamples* out);

/// Every `stride`-th sample, beginning in the middle of a stride, with weights that sum to 1 again.
void TakeEvery(const LineSamples& samples, size_t stride, LineSamples* out);

}  // namespace plumb
