// Cuts segments at the border of the image.
#pragma once

#include "plumb/geometry/segment.h"

namespace plumb {

/// Shortens `segment` to its part inside the image, whose area is [-0.5, width - 0.5] x
/// [-0.5, height - 0.5] px; its direction is kept.
/// @return false if nothing of it is inside, its length is 0 or a coordinate is not finite;
///         `segment` is then unspecified.
/// Source: Liang and Barsky, "A new concept and method for line clipping", 1984.
bool ClipToImage(int width_px, int height_px, Segment2* segment);

}  // namespace plumb
