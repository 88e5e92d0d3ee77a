#include "plumb/matching/support.h"

#include <algorithm>
#include <bit>

#include "plumb/base/simd_clones.h"
#include "plumb/matching/overlap_geometry.h"

namespace plumb {
namespace {

constexpr size_t kLanes = SegmentTable::kLanes;
constexpr float kMaxSine = 0.12f;
constexpr float kHalfWidth = 0.126f;  // asin(0.12), and what lines do not know of their angle
constexpr float kMinOverlapPx = 8.0f;
constexpr float kInverseSquareScale = 1.0f / (2.0f * 2.0f);  // Geman-McClure at 2 px
constexpr float kLengthCapPx = 150.0f;

/// @return the line's best support by one of `count` segments; `best` are the segments' own.
/// Supports are not negative, so that their bits order as integers do: that maximum vectorises.
PLUMB_SIMD_CLONES float SupportKernel(const ImageLine line, float weight, size_t count,
                                      const float* __restrict x0, const float* __restrict y0,
                                      const float* __restrict x1, const float* __restrict y1,
                                      const float* __restrict dx, const float* __restrict dy,
                                      float* __restrict best) {
  int32_t line_best = 0;
  for (size_t k = 0; k < count; ++k) {
    const OverlapGeometry o = MeasureOverlap(line, x0[k], y0[k], x1[k], y1[k], dx[k], dy[k]);
    const float q = 1.0f / (1.0f + o.square * kInverseSquareScale);
    // A mask, since a condition would become a branch.
    const int32_t counts = (o.overlap > kMinOverlapPx) & (o.sine < kMaxSine);
    const int32_t support = std::bit_cast<int32_t>(o.overlap * q * q) & -counts;
    line_best = std::max(line_best, support);
    best[k] = std::max(best[k], std::bit_cast<float>(support) * weight);
  }
  return std::bit_cast<float>(line_best);
}

}  // namespace

PoseSupport SupportMeter::Measure(const ProjectedLines& lines, const SegmentTable& segments) {
  best_.assign(segments.size() + kLanes, 0.0f);
  double explained = 0.0, visible = 0.0;
  for (size_t i = 0; i < lines.size(); ++i) {
    if (!(lines.length[i] > 0.0f)) continue;
    const ImageLine line{lines.x[i], lines.y[i], lines.direction_x[i], lines.direction_y[i],
                         lines.length[i]};
    float line_best = 0.0f;
    for (const SegmentTable::Range range : segments.Within(lines.angle[i], kHalfWidth)) {
      const size_t b = range.begin, count = range.end - range.begin;
      if (count == 0) continue;
      // Rows after the range are too slanted to count, or padding.
      line_best = std::max(
          line_best,
          SupportKernel(line, lines.weight[i], (count + kLanes - 1) / kLanes * kLanes,
                        segments.x0.data() + b, segments.y0.data() + b, segments.x1.data() + b,
                        segments.y1.data() + b, segments.direction_x.data() + b,
                        segments.direction_y.data() + b, best_.data() + b));
    }
    explained += static_cast<double>(lines.weight[i]) * std::min(line_best, kLengthCapPx);
    visible += static_cast<double>(lines.weight[i]) * std::min(line.length, kLengthCapPx);
  }
  PoseSupport support;
  for (size_t row = 0; row < segments.size(); ++row) {
    support.detected_px += std::min(best_[row], kLengthCapPx);
  }
  support.map_share = explained / std::max(visible, 1.0);
  return support;
}

}  // namespace plumb
