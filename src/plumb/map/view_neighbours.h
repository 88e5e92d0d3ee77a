// Which key frames look at what a key frame sees, from places that tell its depth?
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/rigid3.h"

namespace plumb {

struct ViewNeighbourOptions {
  uint32_t max_neighbours = 20;
  double max_axis_angle_rad = 1.0;  // between the optical axes
  /// A frame is left out when one that was chosen before lies nearer to it than this share of its
  /// own distance: a slow camera's frames must not fill the list with short baselines.
  double min_spacing = 0.2;
};

/// Other frames with another centre, by ascending distance [m] + angle [rad]; ties by index.
std::vector<uint32_t> ViewNeighbours(std::span<const Rigid3> cam_from_world, uint32_t frame,
                                     const ViewNeighbourOptions& options = {});

}  // namespace plumb
