// From an uncertain prior pose to a few poses that are near enough for matching.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/base/deadline.h"
#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/search/direction_clusters.h"
#include "plumb/search/direction_field.h"
#include "plumb/search/field_alignment.h"
#include "plumb/search/field_score.h"
#include "plumb/search/line_samples.h"
#include "plumb/search/random.h"
#include "plumb/search/rotation_search.h"
#include "plumb/search/search_line.h"

namespace plumb {

/// Where to search: camera centre and rotation are independent; norms, one standard deviation.
struct SearchRegion {
  Rigid3 cam_from_world;
  double rotation_sigma_rad = 0.035;
  double position_sigma_m = 0.10;
  /// Where gravity is known: unit, and the standard deviation of either angle of tilt against it;
  /// rotation_sigma_rad / sqrt(3) is then that of the turn about it. Zero: not known.
  Eigen::Vector3f down_in_camera = Eigen::Vector3f::Zero();
  double tilt_sigma_rad = 0.0;
};

struct PoseSearchOptions {
  uint32_t num_hypotheses = 1500;
  size_t num_aligned = 32;   // best hypotheses that are aligned, beside the prior itself
  size_t num_wide = 20;      // of them, also aligned from the widest sigma on
  size_t num_survivors = 4;  // distinct poses returned at most
  /// Shares of it after which no more hypotheses are scored, and none aligned further. Where the
  /// first one has passed at the start, only as many are drawn as are scored in any case.
  Deadline deadline = {};
  double score_share = 0.35, align_share = 0.6;
};

/// What a search did, and where its time went [ns].
struct PoseSearchStats {
  int64_t draw_ns = 0;   // samples, hypotheses, rotations first
  int64_t score_ns = 0;  // of all hypotheses
  int64_t align_ns = 0;
  uint32_t num_scored = 0;   // hypotheses
  bool out_of_time = false;  // hypotheses or levels of the alignment were left out
};

struct FoundPose {
  Rigid3 cam_from_world;
  double score = 0.0;  // FieldScorer's at 3 px
};

/// Hypotheses from the prior (half of them with the rotation found first), scored on a direction
/// field of quarter resolution: all of them by an eighth of the samples, the better ones by all.
/// The best are aligned on the same field while sigma shrinks from 30 to 3 px, and once more from
/// 12 px only: at 30 px most starts run into one optimum, which need not be the right one. At each
/// level duplicates and the worse ones are dropped, more of them where fewer are aligned. Images
/// wider than 960 px are searched as if 640 px wide. Equal inputs and seeds give equal results.
/// Owns its work space, does not allocate once warm; not thread-safe.
/// Source: docs/method/association.md.
class PoseSearch {
 public:
  /// Chooses the image of the searches to come, and makes its distance field.
  void SetImage(const Camera& camera, std::span<const Segment2> segments);

  /// Searches the image that was set.
  /// @return up to num_survivors poses, best first, any two more than 2 cm or 0.01 rad apart; valid
  ///         until the next call. Empty without lines or segments.
  std::span<const FoundPose> Search(const SearchRegion& region, std::span<const SearchLine> lines,
                                    const PoseSearchOptions& options, uint64_t seed);

  /// Of the last search.
  const PoseSearchStats& stats() const { return stats_; }

 private:
  struct Hypothesis {
    RelativePose pose;  // cam_from_prior
    float score = 0.0f;
    uint32_t rank = 0;  // order of drawing, breaks ties
  };

  void DrawHypotheses(const SearchRegion& region, std::span<const SearchLine> lines,
                      uint32_t num_hypotheses, uint64_t seed);
  void Rank(double sigma_px, const LineSamples& samples);
  void Sort();  // best first
  /// Keeps the best by a few samples, then the best of those by all.
  void RankAllInTwoPasses(const PoseSearchOptions& options);
  void Align(const SearchRegion& region, const PoseSearchOptions& options);
  void DropDuplicates();
  void CollectSurvivors(const SearchRegion& region, size_t max_survivors);

  Camera camera_;                   // of the searched image
  std::vector<Segment2> segments_;  // in the searched image
  LineSamples samples_, half_samples_, few_samples_;
  DirectionField field_;
  DirectionClusterer clusterer_;
  std::vector<SearchLine> lines_in_prior_;
  std::vector<DirectionCluster> clusters_;
  RotationSearch rotation_search_;
  std::vector<Eigen::Matrix3f> rotations_;
  FieldScorer scorer_;
  FieldAligner aligner_;
  std::vector<Hypothesis> hypotheses_, late_;  // late_ are aligned from the smaller sigma on
  bool is_ranked_ = false;  // whether the last level has ranked as the survivors are
  std::vector<FoundPose> found_;
  PoseSearchStats stats_;
};

}  // namespace plumb
