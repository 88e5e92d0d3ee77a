// Soft association of projected map lines with detected segments.
#pragma once

#include <cstdint>
#include <vector>

#include "plumb/matching/candidate_line.h"
#include "plumb/matching/overlap.h"
#include "plumb/matching/segment_table.h"

namespace plumb {

/// How far apart a line and a segment may be.
struct AssociationGates {
  double sigma_px = 2.0;     // of the perpendicular distance; pairs beyond 3 sigma do not exist
  double sigma_sine = 0.05;  // of the sine of the angle, likewise
  double min_overlap_px = 8.0;
  double min_overlap_share = 0.3;  // of the shorter of the two
};

/// Candidate line `line` explains segment `segment` with probability `weight`.
struct LinePair {
  uint32_t line = 0;     // index into the candidates
  uint32_t segment = 0;  // index into the segments that SegmentTable::Assign() got
  float weight = 0.0f;   // 0..1, without the line's own weight
  float overlap_px = 0.0f;
  float begin = 0.0f, end = 1.0f;  // the overlap's ends as parameters on the segment
  float square_px2 = 0.0f;         // mean square distance of the overlap's ends
};

/// Pairs every visible line with every segment inside the gates. With e = exp(-h^2 / (2 sigma^2) -
/// sin^2 / (2 sigma_sine^2)), the weight is min(e / (0.1 + sum of e over the segment's lines),
/// 1.5 e / (0.1 + sum of e over the line's segments)): a segment is explained once, a line may own
/// several fragments, and 0.1 is left for "neither". Owns its work space; not thread-safe.
/// Source: docs/method/association.md.
class SoftAssociator {
 public:
  /// @param out_pairs  Cleared first; ordered by line, then by the segment's orientation.
  void Associate(const ProjectedLines& lines, const SegmentTable& segments,
                 const AssociationGates& gates, std::vector<LinePair>* out_pairs);

 private:
  OverlapColumns columns_;
  std::vector<uint32_t> rows_;      // table row of each pair
  std::vector<float> line_bound_;   // largest factor on each pair that its line allows
  std::vector<float> segment_sum_;  // per table row
};

}  // namespace plumb
