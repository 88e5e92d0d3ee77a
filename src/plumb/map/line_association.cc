#include "plumb/map/line_association.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include <Eigen/Geometry>

namespace plumb {
namespace {

constexpr double kMinLengthPx = 1e-6;

// Undirected: 0 .. pi.
double AngleOf(const Eigen::Vector2d& delta) {
  const double angle = std::atan2(delta.y(), delta.x());
  return angle < 0.0 ? angle + std::numbers::pi : angle;
}

}  // namespace

SegmentsByAngle::SegmentsByAngle(std::span<const Segment2> segments_px) {
  entries_.reserve(2 * segments_px.size());
  for (uint32_t i = 0; i < segments_px.size(); ++i) {
    const Eigen::Vector2d delta = segments_px[i].Delta();
    const double length = delta.norm();
    if (!(length > kMinLengthPx)) continue;
    const double angle = AngleOf(delta);
    const double twin =
        angle < 0.5 * std::numbers::pi ? angle + std::numbers::pi : angle - std::numbers::pi;
    for (const double entry_angle : {angle, twin}) {
      entries_.push_back({entry_angle, i, segments_px[i], delta / length, length});
    }
  }
  std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return std::tie(a.angle_rad, a.segment) < std::tie(b.angle_rad, b.segment);
  });
}

void SegmentsByAngle::AppendCandidates(const ProjectedLine& line, const AssociationGate& gate,
                                       std::vector<AssociationCandidate>* out_candidates) const {
  const Eigen::Vector2d delta = line.segment_px.Delta();
  const double length = delta.norm();
  if (!(length > kMinLengthPx)) return;
  const Eigen::Vector2d direction = delta / length;
  const Eigen::Vector2d normal(-direction.y(), direction.x());
  // Slightly wide; the sine itself decides. Below pi / 2, so that no segment is met twice.
  const double window = std::min(std::asin(std::min(gate.max_sine, 1.0)) + 1e-6, 1.5);
  const double angle = AngleOf(delta);
  const auto by_angle = [](const Entry& entry, double value) { return entry.angle_rad < value; };
  const auto begin = std::lower_bound(entries_.begin(), entries_.end(), angle - window, by_angle);
  for (auto entry = begin; entry != entries_.end() && entry->angle_rad <= angle + window; ++entry) {
    const double sine =
        std::abs(direction.x() * entry->direction.y() - direction.y() * entry->direction.x());
    if (!(sine < gate.max_sine)) continue;
    // Ends of the segment along and across the projected line.
    const Eigen::Vector2d start = entry->segment_px.start - line.segment_px.start;
    const Eigen::Vector2d end = entry->segment_px.end - line.segment_px.start;
    const double along0 = start.dot(direction), along1 = end.dot(direction);
    const double across0 = start.dot(normal), across1 = end.dot(normal);
    const double low = std::max(std::min(along0, along1), 0.0);
    const double high = std::min(std::max(along0, along1), length);
    if (!(high - low > gate.min_overlap * std::min(length, entry->length_px))) continue;
    const double slope = (across1 - across0) / (along1 - along0);
    const double distance = std::max(std::abs(across0 + (low - along0) * slope),
                                     std::abs(across0 + (high - along0) * slope));
    if (!(distance < gate.max_distance_px)) continue;
    out_candidates->push_back({line.line, entry->segment, distance});
  }
}

}  // namespace plumb
