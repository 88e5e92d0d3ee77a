#include "plumb/matching/soft_association.h"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

constexpr float kGateSigmas = 3.0f;
constexpr float kOutlierMass = 0.1f;
constexpr float kFragmentsPerLine = 1.5f;

}  // namespace

void SoftAssociator::Associate(const ProjectedLines& lines, const SegmentTable& segments,
                               const AssociationGates& gates, std::vector<LinePair>* out_pairs) {
  out_pairs->clear();
  rows_.clear();
  line_bound_.clear();
  columns_.Reserve(segments.size());
  segment_sum_.assign(segments.size(), 0.0f);
  const float max_sine = kGateSigmas * static_cast<float>(gates.sigma_sine);
  const float max_distance = kGateSigmas * static_cast<float>(gates.sigma_px);
  const float max_square = max_distance * max_distance;
  const float min_overlap = static_cast<float>(gates.min_overlap_px);
  const float min_share = static_cast<float>(gates.min_overlap_share);
  const float square_factor = static_cast<float>(-0.5 / (gates.sigma_px * gates.sigma_px));
  const float sine_factor = static_cast<float>(-0.5 / (gates.sigma_sine * gates.sigma_sine));

  for (size_t i = 0; i < lines.size(); ++i) {
    float line_sum = 0.0f;
    for (const SegmentTable::Range range : segments.NearAngle(lines.angle[i], max_sine)) {
      MeasureOverlaps(lines, i, segments, range, &columns_);
      for (uint32_t k = 0; k < range.end - range.begin; ++k) {
        const uint32_t row = range.begin + k;
        const float square = columns_.square[k], overlap = columns_.overlap[k];
        if (!(square < max_square) || !(overlap > min_overlap)) continue;
        if (!(columns_.sine[k] < max_sine)) continue;
        if (!(overlap > min_share * std::min(lines.length[i], segments.length[row]))) continue;
        const float e =
            std::exp(square_factor * square + sine_factor * columns_.sine[k] * columns_.sine[k]);
        out_pairs->push_back({.line = lines.line[i],
                              .segment = segments.source[row],
                              .weight = e,
                              .overlap_px = overlap,
                              .begin = columns_.begin[k],
                              .end = columns_.end[k],
                              .square_px2 = square});
        rows_.push_back(row);
        segment_sum_[row] += e;
        line_sum += e;
      }
    }
    // The line's bound is known here; the segments' only once all lines are seen.
    line_bound_.resize(out_pairs->size(), kFragmentsPerLine / (line_sum + kOutlierMass));
  }
  for (size_t p = 0; p < out_pairs->size(); ++p) {
    const float segment_bound = 1.0f / (segment_sum_[rows_[p]] + kOutlierMass);
    (*out_pairs)[p].weight *= std::min(segment_bound, line_bound_[p]);
  }
}

}  // namespace plumb
