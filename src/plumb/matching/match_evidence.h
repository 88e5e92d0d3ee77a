// How unlikely it is that a pose explains the segments by chance.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "plumb/matching/candidate_line.h"
#include "plumb/matching/overlap.h"
#include "plumb/matching/segment_table.h"

namespace plumb {

/// Lines found at a pose, against lines found by chance.
struct MatchEvidence {
  /// Log likelihood ratio of "the camera is here" to "the segments lie anywhere", >= 0 [nats].
  double nats = 0.0;
  double found_share = 0.0;  // of the lines' weight, beyond chance, 0..1
  size_t num_found = 0, num_lines = 0;
};

/// A line is found when a segment lies on it: |sin| < 0.06, ends of the overlap within 2 px (rms),
/// overlap > 8 px and > half of the shorter. By chance that happens with probability
///
///   p_i = 1 - exp(-(n_i + 0.2) 2 px / 40 px)
///
/// for n_i segments of its orientation within 40 px beside it: where the image is full of parallel
/// edges, finding one says little. At the right pose it happens with r + (1 - r) p_i, r the share
/// of the map that is still there and detected, taken where the likelihood is largest:
///
///   nats = max_r [ sum over found lines of w_i log(r / p_i + 1 - r) + log(1 - r) sum of the other
///   w_i ]
///
/// A segment stands for one line, the first in order; others to which it is the nearest say
/// nothing. Among N poses that were tried, N exp(-nats) bounds the number expected to reach so much
/// by chance if lines were independent. Source: docs/adr/0008-evidence-not-counts.md.
///
/// Owns its work space and does not allocate once warm; not thread-safe.
class EvidenceMeter {
 public:
  /// @param lines  Projected at the pose, the most useful first.
  MatchEvidence Measure(const ProjectedLines& lines, const SegmentTable& segments);

 private:
  struct Found {
    double weight;
    double odds;  // 1 / p - 1
  };

  OverlapColumns columns_;
  std::vector<uint8_t> claimed_;  // per table row
  std::vector<Found> found_;
};

}  // namespace plumb
