// Robust least squares over lines and points by Ceres: the paper's cost, and ours as its oracle.
#pragma once

#include <optional>
#include <span>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/refine/line_residual.h"
#include "plumb/refine/normal_equations.h"

namespace plumb {

/// A one-to-one match of the paper.
struct PaperLine {
  Segment3 line_in_world;
  Segment2 segment_px;
  double scale_px = 0.0;  // s of PtLine eq. 7, frozen during one solve
};

struct JointSolverOptions {
  double huber_px = 2.0;  // of the paper's cost, > 0
  LineResidual paper_residual = LineResidual::kMidpointAngle;  // of the paper's cost
  /// Scales of the overlap cost's Geman-McClure loss, in deviations of a residual, > 0.
  double line_robust = 1.0, point_robust = 3.0;
  int max_iterations = 25;  // >= 1
};

struct JointSolution {
  Rigid3 cam_from_world;
  double initial_cost = 0.0, final_cost = 0.0;
  int num_lines = 0, num_points = 0;  // that could be evaluated at the start
  int num_iterations = 0;
};

/// Minimises PtLine eq. 8 with Huber's loss on each norm:
///
///   alpha sum_i (|d_i| + |theta_i|) + beta sum_j |e_j|,  alpha = M / (N + M), beta = N / (N + M)
///
/// for N lines and M points; eq. 5 (alpha = 1) without points. With kPerpendicular, the norm of the
/// distances of both ends of the segment stands for |d_i| + |theta_i|. Matches that have no image
/// at `start` are left out.
/// @return nullopt when an input is not finite, nothing is left, or the solver has no usable
///         solution. Convergence does not mean that the pose is observed: see Observe().
std::optional<JointSolution> SolvePaperCost(const Camera& camera, const Rigid3& start,
                                            std::span<const PaperLine> lines,
                                            std::span<const PointObservation> points,
                                            const JointSolverOptions& options);

/// Minimises the overlap distances over each observation's standard deviation, the points whitened
/// by pixel noise and depth deviation, and the prior. The loss is that of AccumulateLines() and
/// PointAccumulator, taken once per observation, so that their steps lead to the same pose.
/// @param prior  Optional.
/// @return as SolvePaperCost.
std::optional<JointSolution> SolveOverlapCost(const Camera& camera, const Rigid3& start,
                                              std::span<const LineObservation> lines,
                                              std::span<const PointObservation> points,
                                              const PosePriorFactor* prior,
                                              const JointSolverOptions& options);

}  // namespace plumb
