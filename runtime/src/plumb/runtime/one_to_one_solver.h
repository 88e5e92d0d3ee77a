// The paper's last steps: one-to-one matches by reprojection, one joint cost, and again.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/matching/epipolar_matcher.h"
#include "plumb/refine/joint_solver.h"

namespace plumb {

/// Owns its work space; allocates in Ceres. Source: PtLine Modules III and IV.
class OneToOneSolver {
 public:
  /// Matches again after every solution, three times in all; ends early when fewer than 4 lines
  /// match, or when there is no usable solution.
  /// @param lines       3D lines that MatchCandidate::line indexes.
  /// @param candidates  Sorted, without duplicates.
  void Solve(const Camera& camera, std::span<const Segment2> segments,
             std::span<const Segment3> lines, std::span<const MatchCandidate> candidates,
             std::span<const PointObservation> points, LineResidual residual,
             Rigid3* cam_from_world);

  /// The last one-to-one matches: those of the solution, or those at its pose where they were too
  /// few for another.
  const std::vector<LineAssignment>& assignments() const { return assignments_; }

 private:
  std::vector<LineAssignment> assignments_;
  std::vector<PaperLine> paper_lines_;
};

}  // namespace plumb
