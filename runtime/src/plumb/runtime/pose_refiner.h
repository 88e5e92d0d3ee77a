// From a prior pose and 2D segments to a refined pose, its covariance and an honest status.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "plumb/base/deadline.h"
#include "plumb/base/result.h"
#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/map_index.h"
#include "plumb/refine/line_residual.h"

namespace plumb {

/// What became of a frame. Only kRefined changes the pose; every other status returns the prior.
enum class RefineStatus {
  kRefined,
  kKeptPrior,   // the best pose found does not explain the lines better than the prior does
  kAmbiguous,   // a clearly different pose explains the lines as well, or the best one contradicts
                // its prior by 3 deviations and more
  kDegenerate,  // the matched lines leave a direction of the pose unobserved
  kLowSupport,  // too few lines, or too little of the visible map was found in the image
};
std::string_view ToString(RefineStatus status);  // "REFINED", "KEPT_PRIOR", ...

/// Gravity as an inertial sensor at rest measures it: it tells tilt, not heading.
struct GravityPrior {
  /// Directions of any length > 0. "Down" may as well be "up" if it is so in both.
  Eigen::Vector3d down_in_camera = Eigen::Vector3d::UnitY();
  Eigen::Vector3d down_in_world = Eigen::Vector3d::UnitY();
  double sigma_rad = 0.0175;  // standard deviation of each of the two angles of tilt, (0, 1]
};

/// A coarse pose and how far off it may be.
struct PosePrior {
  Rigid3 cam_from_world;
  /// Norms of the uncertainty (one standard deviation of the whole vector, not per component), in
  /// [1e-9, 1000] and [1e-9, 3.2].
  double position_sigma_m = 0.10;
  double rotation_sigma_rad = 0.0349;
  /// Makes the tilt more certain than the rest of the rotation. Ignored where it contradicts
  /// `cam_from_world` by more than 5 deviations.
  std::optional<GravityPrior> gravity = std::nullopt;
};

/// Beside the first one, a frame may have so many priors.
inline constexpr size_t kMaxMorePriors = 8;

/// A 2D-3D point correspondence, from the host or from points/.
struct PointMatch {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  /// Standard deviation of the point along the ray of the camera that made it, as a vector in the
  /// world [m]; zero when the point is exact.
  Eigen::Vector3d deviation_in_world = Eigen::Vector3d::Zero();
};

enum class RefineMethod { kSearch, kPaper };

struct PoseRefinerOptions {
  RefineMethod method = RefineMethod::kSearch;
  /// The last word on the pose. Absent: the method's own, kPerpendicular of kSearch and
  /// kMidpointAngle of kPaper; the other one is for comparisons (`plumbline eval ablation`).
  std::optional<LineResidual> residual = std::nullopt;
  /// Of the search, 1..2048. Absent: by the size of the prior, from 500 at 10 cm / 2 deg and less
  /// to 1500 at 30 cm / 6 deg and more.
  std::optional<uint32_t> num_hypotheses = std::nullopt;
  /// Smallest share of the visible map's length that the segments must explain, in (0, 1). Chance
  /// is judged by the evidence; this only refuses poses that are right and of no use.
  double min_map_support = 0.05;
  /// Seed of the search's random draws; the frame's `seed` is mixed in.
  uint64_t seed = 0;
  /// Time that a frame may take, about; 0: as long as it takes, and reproducible. As it runs out,
  /// hypotheses, alignment levels, further starts, further priors, further attempts and the last
  /// steps are left out; RefineStages::out_of_time tells. The acceptance gate never is: a pose with
  /// so little evidence that its rivals have to be looked for is kAmbiguous where there is no time
  /// to. A frame takes about as long as one with 96 hypotheses in any case. Not for kPaper. >= 0.
  int64_t time_budget_ns = 0;

  Status Validate() const;
};

struct RefineInput {
  Camera camera;                       // ideal: segments and points are without a lens
  std::span<const Segment2> segments;  // after RefineSegments
  PosePrior prior;
  /// Other places where the camera may be: hits of a retrieval or a relocaliser, a satellite fix
  /// beside a tracked pose. At most kMaxMorePriors. Each is searched as `prior` is, and the time
  /// grows with their number; the pose that the segments speak for is refined, none is when they
  /// speak for several or for no place. What is kept then is `prior`. Not with kPaper.
  std::span<const PosePrior> more_priors = {};
  std::span<const PointMatch> points;  // optional
  /// False: local refinement only, for priors within about 2 cm / 0.5 deg (stream mode).
  bool search = true;
  uint64_t seed = 0;  // e.g. the frame's number; equal inputs and seeds give equal results
  /// What is left of the frame's time, for frames that several calls work on. Absent: all of
  /// PoseRefinerOptions::time_budget_ns. Not for kPaper.
  std::optional<Deadline> deadline = std::nullopt;
};

/// Segment `segment` of the input explained by map line `line`.
struct LineMatch {
  uint32_t segment = 0;
  uint32_t line = 0;
  double distance_px = 0.0;  // rms perpendicular distance of the overlap's ends
};

/// Where the time of the default method went [ns]; a second attempt is added to the first.
struct RefineStages {
  int64_t index_ns = 0;         // queries of the map's index and the lists made of them
  int64_t field_ns = 0;         // distance fields of the search
  int64_t score_ns = 0;         // drawing and scoring hypotheses
  int64_t coarse_ns = 0;        // aligning them on the field
  int64_t fine_ns = 0;          // soft association on the fused lines
  int64_t support_ns = 0;       // what the acceptance gate compares
  int64_t local_ns = 0;         // last step on the key frames' own lines
  int64_t points_ns = 0;        // pose of the points alone
  int64_t joint_ns = 0;         // lines and points together
  int64_t covariance_ns = 0;    // and observability
  int64_t report_ns = 0;        // matches at the final pose
  uint32_t num_hypotheses = 0;  // that were scored
  bool out_of_time = false;     // something was left out for the time budget

  RefineStages& operator+=(const RefineStages& other);
};

struct RefineResult {
  RefineStatus status = RefineStatus::kLowSupport;
  Rigid3 cam_from_world;  // the prior unless kRefined
  /// Of the left perturbation (rotation [rad], translation [m]) of cam_from_world; the prior's own
  /// unless kRefined.
  Matrix6d covariance = Matrix6d::Identity();
  /// Of the prior that the refined pose was found from: 0 for `prior`, k for more_priors[k - 1].
  uint32_t prior_index = 0;
  int num_observed_directions =
      0;                     // of 6, directions that the matches determine better than the prior
  double map_support = 0.0;  // share of the visible map's length that was found, 0..1
  /// How much likelier the segments are at the pose found than by chance, as a logarithm [nats]
  /// (MatchEvidence); also of poses that were refused.
  double evidence_nats = 0.0;
  /// Support of the best clearly different pose over the winner's; evidence over evidence for poses
  /// from other priors, and where only the key frames' own lines speak for the winner.
  double runner_up_ratio = 0.0;
  std::vector<LineMatch> matches;  // at cam_from_world
  uint32_t num_points_used = 0;
  // Time of the stages [ns].
  int64_t search_ns = 0, match_and_refine_ns = 0, total_ns = 0;
  RefineStages stages;
};

/// Refines poses against one map. Not thread-safe; use one per thread. After the first few frames
/// Refine() allocates only what `out_result` needs to grow, by kSearch with kPerpendicular.
class PoseRefiner {
 public:
  /// `index` is borrowed and must outlive the refiner.
  static Result<std::unique_ptr<PoseRefiner>> Create(const MapIndex& index,
                                                     const PoseRefinerOptions& options);
  ~PoseRefiner();

  /// @return kInvalidArgument naming the value if a pose, camera, uncertainty, segment or point is
  ///         not finite or out of range. "No better pose" is a status, not an error.
  Status Refine(const RefineInput& input, RefineResult* out_result);

  /// As given to Create().
  const PoseRefinerOptions& options() const;

 private:
  struct Impl;
  explicit PoseRefiner(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
