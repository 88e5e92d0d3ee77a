#include "plumb/matching/match_evidence.h"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

constexpr float kMaxSine = 0.06f;
constexpr float kMinOverlapPx = 8.0f, kMinOverlapShare = 0.5f;
constexpr float kMaxDistancePx = 2.0f;
constexpr float kNeighbourhoodPx = 40.0f;
constexpr double kExtraNeighbours = 0.2;  // an empty neighbourhood does not make chance impossible
constexpr int kBisections = 20;

}  // namespace

MatchEvidence EvidenceMeter::Measure(const ProjectedLines& lines, const SegmentTable& segments) {
  columns_.Reserve(segments.size());
  claimed_.assign(segments.size(), 0);
  found_.clear();
  MatchEvidence out;
  double missing_weight = 0.0, found_weight = 0.0;
  for (size_t i = 0; i < lines.size(); ++i) {
    int num_neighbours = 0;
    float best_square = kMaxDistancePx * kMaxDistancePx;
    uint8_t* claim = nullptr;
    for (const SegmentTable::Range range : segments.NearAngle(lines.angle[i], kMaxSine)) {
      MeasureOverlaps(lines, i, segments, range, &columns_);
      for (uint32_t k = 0; k < range.end - range.begin; ++k) {
        const float shorter = std::min(lines.length[i], segments.length[range.begin + k]);
        const float overlap = columns_.overlap[k], square = columns_.square[k];
        if (!(overlap > std::max(kMinOverlapPx, kMinOverlapShare * shorter))) continue;
        if (!(columns_.sine[k] < kMaxSine)) continue;
        if (square < kNeighbourhoodPx * kNeighbourhoodPx) ++num_neighbours;
        if (square < best_square) {
          best_square = square;
          claim = &claimed_[range.begin + k];
        }
      }
    }
    if (claim != nullptr && *claim != 0) continue;
    ++out.num_lines;
    if (claim == nullptr) {
      missing_weight += static_cast<double>(lines.weight[i]);
      continue;
    }
    *claim = 1;
    ++out.num_found;
    const double rate = (num_neighbours + kExtraNeighbours) *
                        static_cast<double>(kMaxDistancePx / kNeighbourhoodPx);
    const double chance = -std::expm1(-rate);
    found_.push_back({static_cast<double>(lines.weight[i]), 1.0 / chance - 1.0});
    found_weight += found_.back().weight;
  }
  // The likelihood is concave in r.
  double low = 0.0, high = 1.0;
  for (int step = 0; step < kBisections; ++step) {
    const double r = 0.5 * (low + high);
    double slope = -missing_weight / (1.0 - r);
    for (const Found& line : found_) slope += line.weight * line.odds / (1.0 + r * line.odds);
    (slope > 0.0 ? low : high) = r;
  }
  if (found_weight > 0.0) out.found_share = low;
  for (const Found& line : found_) out.nats += line.weight * std::log1p(low * line.odds);
  out.nats = std::max(0.0, out.nats + missing_weight * std::log1p(-low));
  return out;
}

}  // namespace plumb
