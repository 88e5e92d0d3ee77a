// Point matches of an image with a lens, as matches of the ideal image that poses are refined in.
#pragma once

#include <vector>

#include "plumb/geometry/rectifier.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// Moves the pixels into the ideal image; drops points that the lens cannot have imaged, keeping
/// the order of the others. Does nothing without a lens.
void RectifyPoints(const Rectifier& rectifier, std::vector<PointMatch>* points);

}  // namespace plumb
