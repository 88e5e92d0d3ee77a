#include "plumb/features/segment_selection.h"

#include <algorithm>
#include <span>

namespace plumb {
namespace {

constexpr double kGrid = 128.0;

bool IsNear(const Segment2& a, const Segment2& b, const Eigen::Vector2d& scale, double limit) {
  const auto squared = [&](const Eigen::Vector2d& p, const Eigen::Vector2d& q) {
    return (p - q).cwiseProduct(scale).squaredNorm();
  };
  return std::min(squared(a.start, b.start) + squared(a.end, b.end),
                  squared(a.start, b.end) + squared(a.end, b.start)) <= limit;
}

}  // namespace

void SelectSegments(const SegmentSelection& selection, int width_px, int height_px,
                    std::vector<Segment2>* segments) {
  const Eigen::Vector2d scale(kGrid / width_px, kGrid / height_px);
  size_t count = 0;
  for (const Segment2& segment : *segments) {
    if (selection.max_count > 0 && count == selection.max_count) break;
    if (segment.score < selection.min_score || segment.Length() < selection.min_length_px) continue;
    const auto is_near = [&](const Segment2& kept) {
      return IsNear(kept, segment, scale, selection.structural_nms);
    };
    if (selection.structural_nms > 0.0 &&
        std::ranges::any_of(std::span(*segments).first(count), is_near)) {
      continue;
    }
    const Segment2 kept = segment;
    (*segments)[count++] = kept;
  }
  segments->resize(count);
}

}  // namespace plumb
