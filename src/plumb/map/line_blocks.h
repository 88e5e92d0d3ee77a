// Map lines in blocks of eight: which of them are in an image, and how long?
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/line_map.h"

namespace plumb {

/// A line that is in the image, or may be.
struct BlockLine {
  uint32_t row = 0;        // block x kLanes + lane
  float length_px = 0.0f;  // of the visible part; negative: single precision cannot decide
};

/// What decides whether a line is in an image, in single precision relative to an own origin of
/// every block, which keeps it exact enough anywhere in the world. Immutable after construction.
class LineBlocks {
 public:
  static constexpr size_t kLanes = 8;

  /// Row i holds line order[i].
  LineBlocks(const LineMap& map, std::span<const uint32_t> order);

  /// The rows of `blocks` whose line is observed by at least `min_observing` key frames and has
  /// `min_length_px` or more inside the image enlarged by `margin_px`, in their order. Decided as
  /// ProjectSegment() decides; what rounding might turn round is returned with a negative length.
  /// No allocation once `out` has the capacity.
  void Project(const Camera& camera, const Rigid3& cam_from_world, double margin_px,
               double min_length_px, uint32_t min_observing, std::span<const uint32_t> blocks,
               std::vector<BlockLine>* out) const;

  /// Position of a row's line, its middle, relative to `from` [m].
  Eigen::Vector3f MidpointFrom(const Eigen::Vector3d& from, uint32_t row) const {
    const Eigen::Vector3f middle(start_x_[row] + end_x_[row], start_y_[row] + end_y_[row],
                                 start_z_[row] + end_z_[row]);
    return (origins_[row / kLanes] - from).cast<float>() + 0.5f * middle;
  }

 private:
  std::vector<Eigen::Vector3d> origins_;  // of each block
  std::vector<float> start_x_, start_y_, start_z_, end_x_, end_y_, end_z_;
  std::vector<int32_t> num_observing_;  // -1: a row without line
};

}  // namespace plumb
