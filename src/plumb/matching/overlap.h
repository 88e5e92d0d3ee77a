// Overlap of one projected line with many segments: the inner loop of all matching.
#pragma once

#include <cstddef>
#include <vector>

#include "plumb/matching/candidate_line.h"
#include "plumb/matching/segment_table.h"

namespace plumb {

/// Work space of MeasureOverlaps: one entry a segment of the range.
struct OverlapColumns {
  std::vector<float> sine;        // |sin| of the angle between line and segment
  std::vector<float> square;      // mean square of the distances at the overlap's two ends [px^2]
  std::vector<float> overlap;     // length of the overlap along the line [px]; <= 0: none
  std::vector<float> begin, end;  // the overlap's ends as parameters on the segment, 0..1

  void Reserve(size_t count);
};

/// Measures line `row` of `lines` against the segments of `range`. The overlap is the part of the
/// segment whose foot points lie on the visible part of the line; distances are perpendicular to
/// the projected infinite line. Entry k belongs to segment range.begin + k. `out` must have been
/// reserved for the table's size.
void MeasureOverlaps(const ProjectedLines& lines, size_t row, const SegmentTable& segments,
                     SegmentTable::Range range, OverlapColumns* out);

}  // namespace plumb
