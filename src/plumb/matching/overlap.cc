#include "plumb/matching/overlap.h"

#include "plumb/base/simd_clones.h"
#include "plumb/matching/overlap_geometry.h"

namespace plumb {
namespace {

PLUMB_SIMD_CLONES void MeasureKernel(const ImageLine line, const float* __restrict x0,
                                     const float* __restrict y0, const float* __restrict x1,
                                     const float* __restrict y1, const float* __restrict dx,
                                     const float* __restrict dy, size_t count,
                                     float* __restrict sine, float* __restrict square,
                                     float* __restrict overlap, float* __restrict begin,
                                     float* __restrict end) {
  for (size_t k = 0; k < count; ++k) {
    const OverlapGeometry o = MeasureOverlap(line, x0[k], y0[k], x1[k], y1[k], dx[k], dy[k]);
    sine[k] = o.sine;
    square[k] = o.square;
    overlap[k] = o.overlap;
    begin[k] = o.begin;
    end[k] = o.end;
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
  const ImageLine line{lines.x[row], lines.y[row], lines.direction_x[row], lines.direction_y[row],
                       lines.length[row]};
  const size_t b = range.begin;
  MeasureKernel(line, segments.x0.data() + b, segments.y0.data() + b, segments.x1.data() + b,
                segments.y1.data() + b, segments.direction_x.data() + b,
                segments.direction_y.data() + b, range.end - range.begin, out->sine.data(),
                out->square.data(), out->overlap.data(), out->begin.data(), out->end.data());
}

}  // namespace plumb
