#include "plumb/features/straighten.h"

#include <array>
#include <cmath>

namespace plumb {
namespace {

constexpr int kSamples = 9;

}  // namespace

std::optional<StraightenedSegment> StraightenSegment(const Rectifier& rectifier,
                                                     const Segment2& segment_px) {
  std::array<Eigen::Vector2d, kSamples> points;
  size_t count = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (int i = 0; i < kSamples; ++i) {
    const double u = static_cast<double>(i) / (kSamples - 1);
    const auto ideal = rectifier.ToIdeal(segment_px.start + u * segment_px.Delta());
    if (!ideal) continue;
    mean += *ideal;
    points[count++] = *ideal;
  }
  if (count < 2) return std::nullopt;
  mean /= static_cast<double>(count);
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d d = points[i] - mean;
    xx += d.x() * d.x();
    xy += d.x() * d.y();
    yy += d.y() * d.y();
  }
  const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);  // of the larger eigenvector
  const Eigen::Vector2d unit(std::cos(angle), std::sin(angle));
  const Eigen::Vector2d &first = points[0], &last = points[count - 1];
  return StraightenedSegment{
      {mean + unit.dot(first - mean) * unit, mean + unit.dot(last - mean) * unit, segment_px.score},
      {first, last, segment_px.score}};
}

std::vector<Segment2> StraightenSegments(const Rectifier& rectifier,
                                         std::vector<Segment2> segments_px) {
  if (rectifier.IsIdentity()) return segments_px;
  std::erase_if(segments_px, [&rectifier](Segment2& segment) {
    const std::optional<StraightenedSegment> straight = StraightenSegment(rectifier, segment);
    if (straight) segment = straight->nearest;
    return !straight;
  });
  return segments_px;
}

}  // namespace plumb
