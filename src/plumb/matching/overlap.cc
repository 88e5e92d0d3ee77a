#include "plumb/matching/overlap.h"

#include <algorithm>
#include <cmath>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

struct Line {
  float x, y, direction_x, direction_y, length;
};

PLUMB_SIMD_CLONES void MeasureKernel(const Line line, const float* __restrict x0,
                                     const float* __restrict y0, const float* __restrict x1,
                                     const float* __restrict y1, const float* __restrict dx,
                                     const float* __restrict dy, size_t count,
                                     float* __restrict sine, float* __restrict square,
                                     float* __restrict overlap, float* __restrict begin,
                                     float* __restrict end) {
  for (size_t k = 0; k < count; ++k) {
    const float ax = x0[k] - line.x, ay = y0[k] - line.y;
    const float bx = x1[k] - line.x, by = y1[k] - line.y;
    const float along_a = ax * line.direction_x + ay * line.direction_y;
    const float along_b = bx * line.direction_x + by * line.direction_y;
    const float across_a = ay * line.direction_x - ax * line.direction_y;
    const float across_b = by * line.direction_x - bx * line.direction_y;
    const float low = std::min(along_a, along_b), high = std::max(along_a, along_b);
    const float first = std::max(low, 0.0f), last = std::min(high, line.length);
    const float extent = along_b - along_a;
    // Perpendicular segments have no extent; their sine keeps them out of every gate.
    const float inverse = 1.0f / (std::abs(extent) < 1e-6f ? 1e-6f : extent);
    const float u0 = (first - along_a) * inverse, u1 = (last - along_a) * inverse;
    const float h0 = across_a + u0 * (across_b - across_a);
    const float h1 = across_a + u1 * (across_b - across_a);
    sine[k] = std::abs(line.direction_x * dy[k] - line.direction_y * dx[k]);
    square[k] = 0.5f * (h0 * h0 + h1 * h1);
    overlap[k] = last - first;
    begin[k] = u0;
    end[k] = u1;
  }
}

}  // namespace

void OverlapColumns::Reserve(size_t count) {
  for (std::vector<float>* column : {&sine, &square, &overlap, &begin, &end}) {
    if (column->size() < count) column->resize(count);
  }
}

void MeasureOverlaps(const ProjectedLines& lines, size_t row, const SegmentTable& segments,
                     SegmentTable::Range range, OverlapColumns* out) {
  const Line line{lines.x[row], lines.y[row], lines.direction_x[row], lines.direction_y[row],
                  lines.length[row]};
  const size_t b = range.begin;
  MeasureKernel(line, segments.x0.data() + b, segments.y0.data() + b, segments.x1.data() + b,
                segments.y1.data() + b, segments.direction_x.data() + b,
                segments.direction_y.data() + b, range.end - range.begin, out->sine.data(),
                out->square.data(), out->overlap.data(), out->begin.data(), out->end.data());
}

}  // namespace plumb
