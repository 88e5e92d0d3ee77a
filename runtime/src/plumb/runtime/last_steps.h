// What happens to a pose once the search has led to it: the key frames' own lines, points, matches.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/map_index.h"
#include "plumb/matching/candidate_line.h"
#include "plumb/matching/soft_association.h"
#include "plumb/refine/point_terms.h"
#include "plumb/runtime/fine_alignment.h"
#include "plumb/runtime/line_selection.h"
#include "plumb/runtime/one_to_one_solver.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// Owns its work space and, but for SolveOneToOne(), does not allocate once warm; not thread-safe.
/// Source: docs/method/association.md, "search", step 7 and "With points".
class LastSteps {
 public:
  /// What a frame's poses are aligned with; all of it is borrowed.
  struct Frame {
    Camera camera;
    const FrameSegments* segments = nullptr;
    std::span<const PointObservation> points;
    const PointTable* point_table = nullptr;  // of the same points
  };

  /// Both are borrowed.
  LastSteps(const MapIndex& index, FineLines* fine_lines)
      : selector_(index), fine_lines_(*fine_lines) {}

  void Begin(const Frame& frame);

  /// On the unfused lines of the nearest key frames. @return false when there are fewer than 20:
  /// the alignment is as it was.
  bool AlignOnLocalLines(const PosePriorFactor& prior, FineAlignment* alignment);
  /// Those of the last alignment on them, however few.
  const std::vector<CandidateLine>& local_lines() const { return local_lines_; }
  void ForgetLocalLines() { local_lines_.clear(); }

  /// Together with the points that lie near, if there are any, on the local lines unless those were
  /// forgotten or too few.
  void AlignWithPoints(const PosePriorFactor& prior, FineAlignment* alignment);

  /// Instead of both: the paper's cost on one-to-one matches, from where the alignment ends.
  void SolveOneToOne(FineAlignment* alignment);

  /// Appends each segment's best line at a pose.
  void AppendMatches(const Rigid3& cam_from_world, std::vector<LineMatch>* matches);

 private:
  void AssociateFineLines(const Rigid3& cam_from_world);

  LineSelector selector_;
  FineLines& fine_lines_;
  Frame frame_;
  FineAligner aligner_;
  std::vector<CandidateLine> local_lines_;
  PointTable near_points_;
  PointTableAccumulator point_terms_;
  std::vector<uint32_t> near_rows_;
  ProjectedLines projected_;
  SoftAssociator associator_;
  std::vector<LinePair> pairs_;
  std::vector<int32_t> best_pair_;  // per segment
  OneToOneSolver one_to_one_solver_;
  std::vector<Segment3> lines_to_match_;
  std::vector<MatchCandidate> match_candidates_;
  std::vector<PointObservation> near_observations_;
};

}  // namespace plumb
