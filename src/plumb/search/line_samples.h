// Points along 3D lines, as the search looks them up in the direction field.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/search/search_line.h"

namespace plumb {

/// A line's samples: the first one and the way to the next, in the camera frame of the pose that
/// they were taken for, which keeps single precision exact enough anywhere in the world.
struct SampledLine {
  Eigen::Vector3f first = Eigen::Vector3f::UnitZ();  // [m]
  Eigen::Vector3f step = Eigen::Vector3f::UnitX();   // [m]; along the line too where it is the last
  float weight = 0.0f;                               // of each of its samples
  uint32_t num_samples = 0;                          // 1..kMaxSamples
};

/// The samples of many lines. Lines with equally many are neighbours in `columns`, eight of them a
/// group, filled up with lines of weight 0: what the samples of a line share, its motion and its
/// direction in the image, is computed once a line and for eight lines at a time.
struct LineSamples {
  static constexpr size_t kLanes = 8;
  static constexpr uint32_t kMaxSamples = 4;  // a line

  std::vector<SampledLine> lines;  // in the order they were given in
  size_t count = 0;                // samples; their weights sum to 1

  /// One entry a line of a group.
  struct Columns {
    std::vector<float> x, y, z, step_x, step_y, step_z, weight;
  };
  Columns columns;
  std::vector<uint32_t> group_samples;  // samples of each line of a group
  size_t num_slots = 0;                 // samples with the padding: [group][sample][lane]
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
