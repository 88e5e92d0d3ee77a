// Overlap of one projected line with one segment: the geometry inside every vectorised loop over
// segments.
#pragma once

#include <algorithm>
#include <cmath>

namespace plumb {

/// A projected line [px]: its start, unit direction and length.
struct ImageLine {
  float x, y, direction_x, direction_y, length;
};

/// What OverlapColumns (overlap.h) holds of one segment.
struct OverlapGeometry {
  float sine, square, overlap, begin, end;
};

/// The segment from (x0, y0) to (x1, y1) [px] with unit direction (dx, dy). Without branches.
inline OverlapGeometry MeasureOverlap(const ImageLine& line, float x0, float y0, float x1, float y1,
                                      float dx, float dy) {
  const float ax = x0 - line.x, ay = y0 - line.y;
  const float bx = x1 - line.x, by = y1 - line.y;
  const float along_a = ax * line.direction_x + ay * line.direction_y;
  const float along_b = bx * line.direction_x + by * line.direction_y;
  const float across_a = ay * line.direction_x - ax * line.direction_y;
  const float across_b = by * line.direction_x - bx * line.direction_y;
  const float first = std::max(std::min(along_a, along_b), 0.0f);
  const float last = std::min(std::max(along_a, along_b), line.length);
  const float extent = along_b - along_a;
  // Perpendicular segments have no extent; their sine keeps them out of every gate.
  const float inverse = 1.0f / (std::abs(extent) < 1e-6f ? 1e-6f : extent);
  const float u0 = (first - along_a) * inverse, u1 = (last - along_a) * inverse;
  const float h0 = across_a + u0 * (across_b - across_a);
  const float h1 = across_a + u1 * (across_b - across_a);
  return {std::abs(line.direction_x * dy - line.direction_y * dx), 0.5f * (h0 * h0 + h1 * h1),
          last - first, u0, u1};
}

}  // namespace plumb
