#include "plumb/matching/soft_association.h"

namespace plumb {

void SoftAssociator::Associate(const ProjectedLines& lines, const SegmentTable& segments,
                               const AssociationGates& gates, std::vector<LinePair>* out_pairs) {
  out_pairs->clear();
  list_.Build(lines, segments, gates, 0.0);
  list_.Weigh(lines, gates);
  const PairList::Pairs& pairs = list_.pairs();
  for (size_t p = 0; p < pairs.size(); ++p) {
    out_pairs->push_back({.line = lines.line[static_cast<size_t>(pairs.line[p])],
                          .segment = segments.source[static_cast<size_t>(pairs.segment[p])],
                          .weight = pairs.weight[p],
                          .overlap_px = pairs.overlap[p],
                          .begin = pairs.begin[p],
                          .end = pairs.end[p],
                          .square_px2 = pairs.square[p]});
  }
}

}  // namespace plumb
