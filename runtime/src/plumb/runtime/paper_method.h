// The paper's method: epipolar candidates, reprojection gate, one joint cost.
#pragma once

#include <vector>

#include "plumb/geometry/segment.h"
#include "plumb/map/map_index.h"
#include "plumb/matching/candidate_line.h"
#include "plumb/matching/epipolar_matcher.h"
#include "plumb/matching/match_evidence.h"
#include "plumb/matching/support.h"
#include "plumb/refine/normal_equations.h"
#include "plumb/runtime/fine_alignment.h"
#include "plumb/runtime/line_selection.h"
#include "plumb/runtime/one_to_one_solver.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// One per PoseRefiner; input must have been checked. Ends in the same covariance and gate as
/// SearchMethod. Allocates every frame: it is the baseline, not the product.
/// Source: PtLine Modules III and IV; docs/method/association.md, "paper".
class PaperMethod {
 public:
  PaperMethod(const MapIndex& index, const PoseRefinerOptions& options);

  /// @param input  With FuseGravity() applied to its prior.
  /// @param kept   The prior's own pose, which is the answer unless a better one is found.
  void Refine(const RefineInput& input, const Rigid3& kept, RefineResult* result);

 private:
  /// A key frame's segments whose fused lines are known.
  struct View {
    std::vector<Segment2> segments;
    std::vector<uint32_t> lines;
  };

  void CollectCandidates(const RefineInput& input);
  PoseSupport MeasureSupport(const Camera& camera, const Rigid3& cam_from_world);

  const MapIndex& index_;
  const PoseRefinerOptions options_;
  std::vector<View> views_;      // per key frame of the map
  std::vector<Segment3> lines_;  // per line of the map
  LineSelector selector_;
  FrameSegments segments_;
  std::vector<CandidateLine> search_lines_;
  ProjectedLines projected_;
  SupportMeter support_meter_;
  EvidenceMeter evidence_meter_;
  std::vector<uint32_t> factor_key_frames_;
  std::vector<uint32_t> key_frames_;
  std::vector<MatchCandidate> candidates_;
  OneToOneSolver solver_;
  std::vector<PointObservation> points_;
  std::vector<LineObservation> observations_;
};

}  // namespace plumb
