// The default method: search over the prior's uncertainty, then soft annealed association.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "plumb/base/deadline.h"
#include "plumb/map/map_index.h"
#include "plumb/matching/candidate_line.h"
#include "plumb/matching/candidate_table.h"
#include "plumb/matching/match_evidence.h"
#include "plumb/matching/support.h"
#include "plumb/runtime/acceptance_gate.h"
#include "plumb/runtime/expected_evidence.h"
#include "plumb/runtime/fine_alignment.h"
#include "plumb/runtime/last_steps.h"
#include "plumb/runtime/line_selection.h"
#include "plumb/runtime/point_solver.h"
#include "plumb/runtime/pose_refiner.h"
#include "plumb/runtime/prior_choice.h"
#include "plumb/search/pose_search.h"

namespace plumb {

/// One per PoseRefiner; input must have been checked. Owns all work space. Each of several priors
/// is searched as if it were the only one, those without success once more and farther off when
/// none has any; ChoosePrior() decides between what was found. Which attempts a frame makes is in
/// search_method.cc, one attempt in search_attempt.cc. Source: docs/method/association.md,
/// "search".
class SearchMethod {
 public:
  SearchMethod(const MapIndex& index, const PoseRefinerOptions& options);

  /// @param input  With FuseGravity() applied to its priors.
  /// @param kept   The first prior's own pose, which is the answer unless a better one is found.
  void Refine(const RefineInput& input, const Rigid3& kept, RefineResult* result);

 private:
  static constexpr size_t kMaxSurvivors = 4;
  /// Shares of the time budget after which no further start, attempt or last step begins.
  static constexpr double kStartsShare = 0.75, kWideningShare = 0.4, kLastStepsShare = 0.9;
  /// So much evidence that no key frame asks for more.
  static constexpr double kPlentyOfNats = 60.0;
  /// A pose from so many points is a start for the lines.
  static constexpr size_t kMinSolvingPoints = 12;

  /// A pose that the search has led to.
  struct Survivor {
    FineAlignment alignment;  // on the lines that have the most evidence for it
    PoseSupport support;      // on the search lines
    // MatchEvidence, where it was measured: of the fused lines, and of them or the key frames' own
    // lines, whichever is more.
    double fused_nats = 0.0, nats = 0.0;
    bool is_by_key_frames = false;  // the latter

    bool IsWeak() const { return fused_nats < kWeakNats; }
  };
  /// One try to find the pose within an uncertainty.
  struct Attempt {
    RefineStatus status = RefineStatus::kLowSupport;
    bool has_pose = false;  // something was found, whatever it is worth
    GateEvidence evidence;
    Survivor best;
    std::optional<Rigid3> runner_up;  // the best pose that is clearly different
  };
  /// How an attempt searches.
  struct Plan {
    PosePrior prior;
    uint32_t num_hypotheses = 1;
    bool is_close = false;  // around a pose that was found: wide alignment would lead back to it
    bool is_last = false;  // the key frames' own lines are asked for what the fused ones leave open
  };
  /// What was tried around one of the frame's priors.
  struct Trial {
    RefineInput input;  // the frame's, with this prior alone
    PosePrior prior;    // as the last attempt searched it: the input's, or wider
    PointPose points;   // without inliers: none
    Attempt attempt;
  };

  /// Searches around every prior.
  void BeginTrials(const RefineInput& input);
  void AddTrial(const RefineInput& input, size_t prior);
  /// Searches farther off around every prior where that can help, unless one has succeeded.
  void WidenTrials();
  bool HasSucceeded(const Trial& trial) const;
  bool HasAnySucceeded() const;
  bool ShouldWiden(const Trial& trial) const;
  /// Searches close to what was found around each prior, where the map's key frames have much more
  /// evidence for their poses: a local optimum beside the right pose explains many lines, too. What
  /// was refused is looked at only while nothing has succeeded.
  void LookCloser();
  bool IsDoubtful(const Attempt& attempt);
  /// To draw from a prior of this size.
  uint32_t NumHypotheses(const PosePrior& prior) const;
  PriorChoice Choose(const Camera& camera);
  Attempt Try(const Trial& trial, const Plan& plan);
  /// Decides on a survivor. @param attempt  Its verdict is replaced.
  void Judge(const RefineInput& input, const PosePrior& prior, const Survivor& best,
             Attempt* attempt);
  /// Whether a search with a larger uncertainty can still help.
  bool MayWiden(const Attempt& attempt) const;
  /// Searches farther off than the prior says, for a pose that has been accepted on little
  /// evidence: takes one with more, and makes the trial ambiguous when another place has nearly as
  /// much. @return whether it took another pose.
  bool LookFarther(Trial* trial);
  /// The prior as a factor of the alignment: it decides only what the lines leave open.
  static PosePriorFactor WeakFactor(const PosePrior& prior);
  void AcceptPoints(const RefineInput& input);
  /// Solves the pose from the points alone, if there are enough.
  PointPose SolvePoints(const RefineInput& input);
  bool HoldsByPoints(const RefineInput& input, const PointPose& points) const;
  std::span<const FoundPose> FindStarts(const Trial& trial, const Plan& plan);
  /// Whether work that starts now has to be left out.
  bool IsOutOfTime(double share = 1.0) { return IsOutOfTime(deadline_, share); }
  bool IsOutOfTime(const Deadline& deadline, double share);
  PoseSupport MeasureSupport(const Camera& camera, const Rigid3& cam_from_world);
  double FusedEvidence(const Camera& camera, const Rigid3& cam_from_world);
  /// Aligns all survivors on the key frames' own lines as well and takes the pose that these lead
  /// to where they have more evidence than the fused lines. @return the one with the most evidence.
  const Survivor& AskKeyFrames(const RefineInput& input, const PosePrior& prior);
  /// The clearly different survivor with the most support over that of `best`; evidence over
  /// evidence where `best` is by key frames.
  void FindRunnerUp(Attempt* attempt) const;
  /// What a pose needs to be accepted, from chance and from the map's own key frames.
  double EvidenceNeeded(const Rigid3& cam_from_world, double nats);
  /// The last steps of a pose that was accepted, and its covariance.
  void Finish(const PosePrior& prior, FineAlignment alignment, RefineResult* result);

  const MapIndex& index_;
  const PoseRefinerOptions options_;
  LineSelector selector_;
  FrameSegments segments_;
  std::vector<CandidateLine> search_lines_;  // visible from the prior; all supports use them
  FineLines fine_lines_;
  LastSteps last_steps_;
  std::vector<SearchLine> lines_to_find_;
  PoseSearch pose_search_;
  std::array<FoundPose, 1> only_prior_;
  CandidateTable search_table_;  // of search_lines_
  FineAligner aligner_;
  SupportMeter support_meter_;
  EvidenceMeter evidence_meter_;
  ExpectedEvidence expected_evidence_;
  ProjectedLines projected_;
  std::vector<Survivor> survivors_;
  PointSolver point_solver_;
  std::vector<PointObservation> observed_points_;
  PointTable all_points_;
  std::vector<uint32_t> key_frames_;
  // Of this frame:
  Rigid3 kept_;                // the caller's pose, returned unless a better one is found
  std::vector<Trial> trials_;  // of its priors, in their order
  std::vector<PriorOutcome> outcomes_;
  uint32_t num_tried_ = 0;     // poses that can be told apart, in all attempts until now
  bool is_image_set_ = false;  // of pose_search_
  int64_t search_ns_ = 0;
  RefineStages stages_;
  Deadline deadline_;
  Deadline try_deadline_;  // of the attempt at hand
};

}  // namespace plumb
