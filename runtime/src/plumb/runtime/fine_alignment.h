// Fine alignment: soft association that narrows step by step, one Gauss-Newton step each.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/matching/candidate_line.h"
#include "plumb/matching/candidate_table.h"
#include "plumb/matching/pair_list.h"
#include "plumb/matching/segment_table.h"
#include "plumb/refine/line_terms.h"
#include "plumb/refine/normal_equations.h"
#include "plumb/refine/point_terms.h"

namespace plumb {

/// One step of an annealing schedule.
struct AlignmentStep {
  double sigma_px;    // of the distance between line and segment
  double sigma_sine;  // of the sine of their angle
  double robust;      // scale of the Geman-McClure weight, in deviations

  bool operator==(const AlignmentStep&) const = default;
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
  double point_scale = 1.0;  // of the points' whitened squares (PointTableAccumulator)
};

/// Owns its work space and does not allocate once warm; not thread-safe.
class FineAligner {
 public:
  /// Chooses what the next runs align.
  /// @param reference  A pose near those to come; the lines' own variances are taken there.
  /// @param segments   Borrowed until the next Begin().
  void Begin(const Camera& camera, const Rigid3& reference, std::span<const CandidateLine> lines,
             const FrameSegments& segments);

  /// Each step associates the lines with the segments and solves once, with `prior` as a factor;
  /// one that moves the image by less than 0.01 px is the last of its equals.
  /// Observations are weighted with pair weight x line weight x overlap (at most 120 px) / 30 px;
  /// their variance is max(0.7, sigma / 2)^2 px^2 plus the line's own. With `points`, the lines'
  /// information is divided by their residual scale, so that each family counts by its own
  /// residuals. Pairs are listed anew only when the pose has moved so far that the list may lack
  /// one.
  FineAlignment Run(const Rigid3& start, std::span<const AlignmentStep> schedule,
                    const PosePriorFactor& prior, const PointTable* points = nullptr);

  /// Gauss-Newton on the last associations of a run with points, one Geman-McClure weight an
  /// observation and the scales as they are, at most `max_steps`, until the step is below 1e-6.
  /// @return the pose.
  Rigid3 Polish(const FineAlignment& alignment, double robust, int max_steps,
                const PosePriorFactor& prior, const PointTable& points);

 private:
  void ListPairs(const AlignmentStep& step);
  void Observe(double sigma_px);
  LineEnds Ends() const;

  Camera camera_;
  const FrameSegments* segments_ = nullptr;
  CandidateTable lines_;
  std::vector<float> map_variance_;
  ProjectedLines projected_;
  PairList list_;
  double listed_sigma_px_ = 0.0;  // gate of the list; 0: there is none
  double moved_px_ = 0.0;         // since it was made, at most
  LineObservationTable observations_;
  LineAccumulator line_terms_;
  PointTableAccumulator point_terms_;
};

}  // namespace plumb
