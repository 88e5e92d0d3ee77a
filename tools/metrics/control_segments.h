// Segments that do not belong to a frame: what a refinement must not be content with.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/segment.h"

namespace plumb::tools {

/// The segments of the image turned left to right; `width_px` > 0.
std::vector<Segment2> MirrorSegments(std::span<const Segment2> segments, int width_px);

/// Segments of the same lengths and scores at random places and in random directions, inside the
/// image as far as they fit. Equal seeds give equal segments.
std::vector<Segment2> ScatterSegments(std::span<const Segment2> segments, int width_px,
                                      int height_px, uint64_t seed);

}  // namespace plumb::tools
