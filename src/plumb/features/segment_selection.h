// Which of the segments that a detector found are worth returning.
#pragma once

#include <cstddef>
#include <vector>

#include "plumb/geometry/segment.h"

namespace plumb {

struct SegmentSelection {
  double min_score = 0.0;
  double min_length_px = 0.0;
  /// Structural NMS: a segment goes when the squared distances of its end points from those of a
  /// better one, with the image scaled to 128 x 128, sum to this or less; 2 in F-Clip, 0: off.
  double structural_nms = 0.0;
  size_t max_count = 0;  // best by score; 0: all
};

/// @param segments  [px] of an image of this size, best score first, and so they stay.
void SelectSegments(const SegmentSelection& selection, int width_px, int height_px,
                    std::vector<Segment2>* segments);

}  // namespace plumb
