// Soft association of projected map lines with detected segments.
#pragma once

#include <cstdint>
#include <vector>

#include "plumb/matching/association_gates.h"
#include "plumb/matching/candidate_line.h"
#include "plumb/matching/pair_list.h"
#include "plumb/matching/segment_table.h"

namespace plumb {

/// Candidate line `line` explains segment `segment` with probability `weight`.
struct LinePair {
  uint32_t line = 0;     // index into the candidates
  uint32_t segment = 0;  // index into the segments that SegmentTable::Assign() got
  float weight = 0.0f;   // 0..1, without the line's own weight
  float overlap_px = 0.0f;
  float begin = 0.0f, end = 1.0f;  // the overlap's ends as parameters on the segment
  float square_px2 = 0.0f;         // mean square distance of the overlap's ends
};

/// Pairs every visible line with every segment inside the gates, weighed as PairList::Weigh() does:
/// a segment is explained once, a line may own several fragments, and a part is left for "neither".
/// Owns its work space; not thread-safe.
class SoftAssociator {
 public:
  /// @param out_pairs  Cleared first; ordered by line, then by the segment's orientation.
  void Associate(const ProjectedLines& lines, const SegmentTable& segments,
                 const AssociationGates& gates, std::vector<LinePair>* out_pairs);

 private:
  PairList list_;
};

}  // namespace plumb
