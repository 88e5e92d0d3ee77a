// How much evidence a map's own key frames have for their poses: what a frame beside them can
// reach.
#pragma once

#include <cstdint>
#include <vector>

#include "plumb/geometry/rigid3.h"
#include "plumb/map/map_index.h"
#include "plumb/matching/candidate_line.h"
#include "plumb/matching/match_evidence.h"
#include "plumb/runtime/fine_alignment.h"
#include "plumb/runtime/line_selection.h"

namespace plumb {

/// A room that is nearly its own mirror image gives a wrong pose more evidence than chance does,
/// but far less than the right one. Key frames are measured when first asked for and remembered.
/// Owns its work space; not thread-safe. Source: docs/adr/0008-evidence-not-counts.md.
class ExpectedEvidence {
 public:
  /// `index` is borrowed and must outlive this.
  explicit ExpectedEvidence(const MapIndex& index);

  /// The least evidence [nats] that one of the three nearest key frames has for its own pose; 0
  /// when there are fewer than three within kMaxDistance.
  double LeastNear(const Rigid3& cam_from_world);

  /// Key frames farther away see something else [m + rad].
  static constexpr double kMaxDistance = 1.0;

 private:
  double EvidenceOf(uint32_t key_frame);

  const MapIndex& index_;
  LineSelector selector_;
  EvidenceMeter meter_;
  ProjectedLines projected_;
  FrameSegments segments_;
  std::vector<Segment2> detected_;
  std::vector<CandidateLine> lines_;
  std::vector<uint32_t> nearest_;
  std::vector<float> known_;  // per key frame; negative: not measured yet
};

}  // namespace plumb
