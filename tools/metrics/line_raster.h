// Pixels of a straight line.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/segment.h"

namespace plumb::tools {

/// The pixels of an image of this size that `segment` crosses: both ends rounded to a pixel (halves
/// up), one pixel for each step along the longer axis, rounded across it (halves up). Pixels
/// outside the image are left out.
/// @param segment  [px], coordinates within +-2^20.
/// @param out_pixels  Replaced; in order from start to end.
void RasterizeLine(const Segment2& segment, int width_px, int height_px,
                   std::vector<Eigen::Vector2i>* out_pixels);

}  // namespace plumb::tools
