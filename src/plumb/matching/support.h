// How well a pose explains what is seen: the evidence that the acceptance gate compares.
#pragma once

#include <vector>

#include "plumb/matching/candidate_line.h"
#include "plumb/matching/segment_table.h"

namespace plumb {

/// Explained length on both sides. Comparable between poses only on the same lines and segments.
struct PoseSupport {
  double detected_px = 0.0;  // D: length of the segments that a line explains, weighted
  double map_share = 0.0;    // M: share of the visible lines' length that segments explain, 0..1
  double Value() const { return detected_px * map_share; }
};

/// Each pair with |sin| < 0.12 and an overlap > 8 px supports with s = overlap / (1 + h^2 / 4)^2.
/// D = sum over segments of min(max_i s w_i, 150), M = sum over lines of w min(max_j s, 150) over
/// sum of w min(length, 150). `lines` are projected with a minimum length of 10 px.
/// Source: docs/method/association.md.
class SupportMeter {
 public:
  PoseSupport Measure(const ProjectedLines& lines, const SegmentTable& segments);

 private:
  std::vector<float> best_;  // per table row
};

}  // namespace plumb
