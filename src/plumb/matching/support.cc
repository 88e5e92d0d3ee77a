#include "plumb/matching/support.h"

#include <algorithm>

namespace plumb {
namespace {

constexpr float kMaxSine = 0.12f;
constexpr float kMinOverlapPx = 8.0f;
constexpr float kInverseSquareScale = 1.0f / (2.0f * 2.0f);  // Geman-McClure at 2 px
constexpr float kLengthCapPx = 150.0f;

}  // namespace

PoseSupport SupportMeter::Measure(const ProjectedLines& lines, const SegmentTable& segments) {
  columns_.Reserve(segments.size());
  best_.assign(segments.size(), 0.0f);
  double explained = 0.0, visible = 0.0;
  for (size_t i = 0; i < lines.size(); ++i) {
    const float weight = lines.weight[i];
    float line_best = 0.0f;
    for (const SegmentTable::Range range : segments.NearAngle(lines.angle[i], kMaxSine)) {
      MeasureOverlaps(lines, i, segments, range, &columns_);
      for (uint32_t k = 0; k < range.end - range.begin; ++k) {
        const float overlap = columns_.overlap[k];
        if (!(overlap > kMinOverlapPx) || !(columns_.sine[k] < kMaxSine)) continue;
        const float q = 1.0f / (1.0f + columns_.square[k] * kInverseSquareScale);
        const float support = overlap * q * q;
        line_best = std::max(line_best, support);
        float& segment_best = best_[range.begin + k];
        segment_best = std::max(segment_best, support * weight);
      }
    }
    explained += static_cast<double>(weight) * std::min(line_best, kLengthCapPx);
    visible += static_cast<double>(weight) * std::min(lines.length[i], kLengthCapPx);
  }
  PoseSupport support;
  for (const float best : best_) support.detected_px += std::min(best, kLengthCapPx);
  support.map_share = explained / std::max(visible, 1.0);
  return support;
}

}  // namespace plumb
