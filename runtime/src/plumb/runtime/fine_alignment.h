// Fine alignment: soft association that narrows step by step, one Gauss-Newton step each.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/matching/candidate_line.h"
#include "plumb/matching/segment_table.h"
#include "plumb/matching/soft_association.h"
#include "plumb/refine/normal_equations.h"

namespace plumb {

/// One step of an annealing schedule.
struct AlignmentStep {
  double sigma_px;    // of the distance between line and segment
  double sigma_sine;  // of the sine of their angle
  double robust;      // scale of the Geman-McClure weight, in deviations
};

// The schedules of docs/method/association.md.
std::span<const AlignmentStep> FineSchedule();    // after the coarse alignment, 8 to 1 px
std::span<const AlignmentStep> StreamSchedule();  // from a prior within 2 cm / 0.5 deg
std::span<const AlignmentStep> LocalSchedule();   // last step, 4 to 1 px
std::span<const AlignmentStep> JointSchedule();   // with points, 5 to 1 px

/// A frame's segments, longest first, in the two forms that the stages need.
struct FrameSegments {
  std::vector<Segment2> segments;
  std::vector<uint32_t> source;  // index into the frame's own list
  SegmentTable table;

  /// Keeps the `max_segments` longest, ties by index.
  void Assign(std::span<const Segment2> all, size_t max_segments);
};

struct FineAlignment {
  Rigid3 cam_from_world;
  Matrix6d line_information = Matrix6d::Zero();   // of the last step, without the prior
  Matrix6d point_information = Matrix6d::Zero();  // already scaled by the points' own residuals
  double residual_scale = 1.0;                    // of the lines (LineEquations)
  size_t num_pairs = 0;                           // of the last step
  int num_points = 0;
  double point_scale = 1.0;  // of the points' whitened squares (PointAccumulator)
};

/// Owns its work space and does not allocate once warm; not thread-safe.
class FineAligner {
 public:
  /// Each step associates `lines` with the segments and solves once, with `prior` as a factor.
  /// Observations are weighted with pair weight x line weight x overlap (at most 120 px) / 30 px;
  /// their variance is max(0.7, sigma / 2)^2 px^2 plus the line's own. With `points`, the lines'
  /// information is divided by their residual scale, so that each family counts by its own
  /// residuals.
  FineAlignment Align(const Camera& camera, const Rigid3& start,
                      std::span<const CandidateLine> lines, const FrameSegments& segments,
                      std::span<const AlignmentStep> schedule, const PosePriorFactor& prior,
                      std::span<const PointObservation> points = {});

  /// The observations of the last step, for a solver that polishes the pose.
  std::span<const LineObservation> observations() const { return observations_; }

 private:
  void Observe(std::span<const CandidateLine> lines, const FrameSegments& segments,
               double sigma_px);

  ProjectedLines projected_;
  SoftAssociator associator_;
  std::vector<LinePair> pairs_;
  std::vector<double> map_variance_;
  std::vector<LineObservation> observations_;
  PointAccumulator points_;
};

}  // namespace plumb
