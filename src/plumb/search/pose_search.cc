#include "plumb/search/pose_search.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "plumb/base/stopwatch.h"

namespace plumb {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// Pixel constants below hold for images of about this size.
constexpr int kMaxSearchWidthPx = 960, kReducedWidthPx = 640;

constexpr DirectionFieldOptions kField{.cell_px = 4, .tolerance_rad = 10.0 * kDegree};
constexpr double kScoringSigmaPx = 20.0;
// First pass: every so manieth sample; so small a share of the hypotheses enters the second where
// kUsualAligned of them are aligned, and in proportion.
constexpr size_t kFewStride = 8, kSecondPassDivisor = 12;
constexpr uint32_t kMinSecondPass = 96;
constexpr size_t kScoredAtOnce = 64;  // between two looks at the clock

// The alignment: so many steps at each sigma, then the best are kept, out of kUsualAligned starts
// and in proportion. Wide sigmas are served by every second sample.
struct Level {
  double sigma_px;
  int num_steps;
  size_t num_kept;
  bool all_samples;
};
constexpr Level kLevels[] = {{30.0, 3, 12, false}, {20.0, 3, 8, false}, {12.0, 2, 28, false},
                             {12.0, 2, 18, false}, {6.0, 3, 10, true},  {3.0, 2, 8, true}};
constexpr size_t kUsualAligned = 32;
constexpr size_t kLateLevel = 2;   // where all enter, past the widest sigmas
constexpr size_t kMinAligned = 8;  // so few are not ranked, likewise in proportion
// Aligned poses nearer than this are one.
constexpr float kDuplicatePositionM = 0.01f, kDuplicateRotationRad = 0.005f;
constexpr double kFinalSigmaPx = 3.0;
constexpr double kPriorScale = 1.5;  // of the alignment's prior factor over the prior's own sigma

constexpr size_t kMaxClusters = 12;
constexpr size_t kRotationSegments = 100;  // the longest; more do not change the ranking
constexpr float kRotationJitter = static_cast<float>(0.5 * kDegree);

// Ties by the order of drawing.
constexpr auto kIsBetter = [](const auto& a, const auto& b) {
  return a.score != b.score ? a.score > b.score : a.rank < b.rank;
};

constexpr double kDistinctPositionM = 0.02, kDistinctRotationRad = 0.01;

Camera Reduce(const Camera& camera, double scale) {
  // Pixel centres: x' + 1/2 = s (x + 1/2).
  Camera out = camera;
  out.fx *= scale;
  out.fy *= scale;
  out.cx = scale * (camera.cx + 0.5) - 0.5;
  out.cy = scale * (camera.cy + 0.5) - 0.5;
  out.width_px = std::max(1, static_cast<int>(std::lround(camera.width_px * scale)));
  out.height_px = std::max(1, static_cast<int>(std::lround(camera.height_px * scale)));
  return out;
}

/// What `count` out of kUsualAligned becomes where another number is aligned.
size_t ShareOf(size_t count, const PoseSearchOptions& options) {
  return std::max<size_t>(1, (count * options.num_aligned + kUsualAligned - 1) / kUsualAligned);
}

}  // namespace

void PoseSearch::SetImage(const Camera& camera, std::span<const Segment2> segments) {
  const double scale = camera.width_px > kMaxSearchWidthPx
                           ? static_cast<double>(kReducedWidthPx) / camera.width_px
                           : 1.0;
  camera_ = scale < 1.0 ? Reduce(camera, scale) : camera;
  segments_.clear();
  for (const Segment2& segment : segments) {
    if (!(segment.Length() > 0.0)) continue;
    const auto reduce = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
      return (scale * (p.array() + 0.5) - 0.5).matrix();
    };
    segments_.push_back(scale < 1.0
                            ? Segment2{reduce(segment.start), reduce(segment.end), segment.score}
                            : segment);
  }
  if (!segments_.empty()) field_.Assign(camera_.width_px, camera_.height_px, segments_, kField);
}

std::span<const FoundPose> PoseSearch::Search(const SearchRegion& region,
                                              std::span<const SearchLine> lines,
                                              const PoseSearchOptions& options, uint64_t seed) {
  found_.clear();
  stats_ = {};
  Stopwatch watch;
  SampleLines(camera_, region.cam_from_world, lines, &samples_);
  if (samples_.count == 0 || segments_.empty()) return found_;

  uint32_t num_drawn = options.num_hypotheses;
  if (num_drawn > kMinSecondPass && options.deadline.HasPassed(options.score_share)) {
    num_drawn = kMinSecondPass;
    stats_.out_of_time = true;
  }
  DrawHypotheses(region, lines, num_drawn, seed);
  stats_.draw_ns = watch.Lap();
  RankAllInTwoPasses(options);
  // The prior itself always takes part.
  const size_t kept = std::min(options.num_aligned, hypotheses_.size());
  const auto prior = std::find_if(hypotheses_.begin(), hypotheses_.end(),
                                  [](const Hypothesis& h) { return h.rank == 0; });
  if (prior - hypotheses_.begin() >= static_cast<ptrdiff_t>(kept)) {
    const Hypothesis keep = *prior;
    hypotheses_.resize(kept);
    hypotheses_.push_back(keep);
  } else {
    hypotheses_.resize(kept);
  }
  stats_.score_ns = watch.Lap();
  Align(region, options);
  CollectSurvivors(region, options.num_survivors);
  stats_.align_ns = watch.Lap();
  return found_;
}

void PoseSearch::DrawHypotheses(const SearchRegion& region, std::span<const SearchLine> lines,
                                uint32_t num_hypotheses, uint64_t seed) {
  Random random(seed);
  const RotationSpread spread{
      .sigma_rad = static_cast<float>(region.rotation_sigma_rad / std::sqrt(3.0)),
      .axis = region.down_in_camera,
      .tilt_sigma_rad = static_cast<float>(region.tilt_sigma_rad)};
  const float position_sigma = static_cast<float>(region.position_sigma_m / std::sqrt(3.0));
  hypotheses_.clear();
  // A camera centre moved by c (in the prior's camera frame) is the translation -R c.
  const auto add = [&](const Eigen::Matrix3f& rotation, const Eigen::Vector3f& shift) {
    Hypothesis& h = hypotheses_.emplace_back();
    h.pose = {rotation, -(rotation * shift)};
    h.rank = static_cast<uint32_t>(hypotheses_.size() - 1);
  };
  add(Eigen::Matrix3f::Identity(), Eigen::Vector3f::Zero());
  const uint32_t num_by_prior = (num_hypotheses + 1) / 2;
  for (uint32_t k = 1; k < num_by_prior; ++k) {
    const Eigen::Matrix3f rotation = RotationFromVector(Draw(spread, &random));
    add(rotation, random.Normal3(position_sigma));
  }
  if (num_hypotheses <= num_by_prior) return;

  lines_in_prior_.clear();
  for (const SearchLine& line : lines) {
    lines_in_prior_.push_back({{region.cam_from_world * line.segment_in_world.start,
                                region.cam_from_world * line.segment_in_world.end},
                               line.weight});
  }
  clusterer_.Cluster(lines_in_prior_, kMaxClusters, &clusters_);
  rotation_search_.Search(
      camera_, std::span(segments_).first(std::min(segments_.size(), kRotationSegments)), clusters_,
      {.num_draws = num_hypotheses, .spread = spread}, &random, &rotations_);
  for (uint32_t k = num_by_prior; k < num_hypotheses; ++k) {
    const Eigen::Matrix3f& found =
        rotations_[random.Below(static_cast<uint32_t>(rotations_.size()))];
    const Eigen::Matrix3f rotation = RotationFromVector(random.Normal3(kRotationJitter)) * found;
    add(rotation, random.Normal3(position_sigma));
  }
}

void PoseSearch::RankAllInTwoPasses(const PoseSearchOptions& options) {
  const size_t num_second = std::max(
      ShareOf(std::max<size_t>(kMinSecondPass, hypotheses_.size() / kSecondPassDivisor), options),
      options.num_aligned);
  stats_.num_scored = static_cast<uint32_t>(hypotheses_.size());
  if (num_second < hypotheses_.size()) {
    TakeEvery(samples_, kFewStride, &few_samples_);
    scorer_.Prepare(camera_, field_, kScoringSigmaPx);
    size_t num_scored = 0;
    while (num_scored < hypotheses_.size()) {
      // Draws from the prior come first, each of them from all of the region.
      const size_t end = std::min(num_scored + kScoredAtOnce, hypotheses_.size());
      for (; num_scored < end; ++num_scored) {
        Hypothesis& h = hypotheses_[num_scored];
        h.score = scorer_.Score(h.pose, few_samples_);
      }
      if (num_scored >= num_second && options.deadline.HasPassed(options.score_share)) break;
    }
    stats_.out_of_time |= num_scored < hypotheses_.size();
    stats_.num_scored = static_cast<uint32_t>(num_scored);
    hypotheses_.resize(num_scored);
    // The prior itself, which comes first, always takes part.
    if (num_second < hypotheses_.size()) {
      std::nth_element(hypotheses_.begin() + 1,
                       hypotheses_.begin() + static_cast<ptrdiff_t>(num_second), hypotheses_.end(),
                       kIsBetter);
      hypotheses_.resize(num_second);
    }
  }
  Rank(kScoringSigmaPx, samples_);
}

void PoseSearch::Rank(double sigma_px, const LineSamples& samples) {
  scorer_.Prepare(camera_, field_, sigma_px);
  for (Hypothesis& h : hypotheses_) h.score = scorer_.Score(h.pose, samples);
  Sort();
}

void PoseSearch::Sort() { std::sort(hypotheses_.begin(), hypotheses_.end(), kIsBetter); }

void PoseSearch::Align(const SearchRegion& region, const PoseSearchOptions& options) {
  TakeEvery(samples_, 2, &half_samples_);
  late_ = hypotheses_;
  is_ranked_ = false;
  hypotheses_.resize(std::min(hypotheses_.size(), options.num_wide));
  for (size_t i = 0; i < std::size(kLevels); ++i) {
    // The late ones enter in any case: better a few levels of all than all of a few.
    if (i > kLateLevel && options.deadline.HasPassed(options.align_share)) {
      stats_.out_of_time = true;
      return;
    }
    const Level& level = kLevels[i];
    if (i == kLateLevel) hypotheses_.insert(hypotheses_.end(), late_.begin(), late_.end());
    const LineSamples& samples = level.all_samples ? samples_ : half_samples_;
    const FieldAlignmentOptions alignment{
        .sigma_px = level.sigma_px,
        .num_steps = level.num_steps,
        .prior_rotation_sigma_rad = kPriorScale * region.rotation_sigma_rad,
        .prior_position_sigma_m = kPriorScale * region.position_sigma_m};
    for (Hypothesis& h : hypotheses_) {
      h.pose = aligner_.Align(camera_, field_, samples, h.pose, alignment);
    }
    is_ranked_ = false;
    if (hypotheses_.size() <= ShareOf(kMinAligned, options)) continue;
    Rank(level.sigma_px, samples);
    is_ranked_ = i + 1 == std::size(kLevels);
    DropDuplicates();
    hypotheses_.resize(std::min(hypotheses_.size(), ShareOf(level.num_kept, options)));
  }
}

void PoseSearch::DropDuplicates() {
  size_t kept = 0;
  for (size_t i = 0; i < hypotheses_.size(); ++i) {
    const RelativePose& pose = hypotheses_[i].pose;
    bool is_duplicate = false;
    for (size_t j = 0; j < kept && !is_duplicate; ++j) {
      const RelativePose& other = hypotheses_[j].pose;
      // For small turns the difference of the matrices is sqrt(2) times the angle.
      is_duplicate = (pose.translation - other.translation).norm() < kDuplicatePositionM &&
                     (pose.rotation - other.rotation).norm() < 1.414f * kDuplicateRotationRad;
    }
    if (!is_duplicate) hypotheses_[kept++] = hypotheses_[i];
  }
  hypotheses_.resize(kept);
}

void PoseSearch::CollectSurvivors(const SearchRegion& region, size_t max_survivors) {
  if (!is_ranked_) Rank(kFinalSigmaPx, samples_);
  for (const Hypothesis& h : hypotheses_) {
    if (found_.size() == max_survivors) return;
    const Rigid3 pose = h.pose.After(region.cam_from_world);
    const bool is_distinct = std::all_of(found_.begin(), found_.end(), [&](const FoundPose& other) {
      const PoseDistance distance = DistanceBetween(pose, other.cam_from_world);
      return distance.position_m > kDistinctPositionM ||
             distance.rotation_rad > kDistinctRotationRad;
    });
    if (is_distinct) found_.push_back({pose, h.score});
  }
}

}  // namespace plumb
