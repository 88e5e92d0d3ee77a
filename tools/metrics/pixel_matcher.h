// The most one-to-one matches between two sets of nearby pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace plumb::tools {

/// Maximum bipartite matching between target and candidate pixels that are at most a distance
/// apart. Candidates may be added one by one; the matching stays the largest, which makes a sweep
/// over score thresholds as cheap as its last step.
///
/// The benchmark's `correspondPixels` minimises the matched distances plus 100 times the reach for
/// every unmatched pixel: as many matches as possible, hence the same counts.
class PixelMatcher {
 public:
  /// @param max_distance_px  Reach, the distance itself included.
  PixelMatcher(int width_px, int height_px, double max_distance_px);

  /// All targets come before the first candidate. A pixel inside the image; a second time is one.
  void AddTarget(const Eigen::Vector2i& pixel);
  void AddCandidate(const Eigen::Vector2i& pixel);

  size_t num_targets() const { return num_targets_; }
  size_t num_candidates() const { return num_candidates_; }
  size_t num_matches() const { return num_matches_; }

 private:
  int IndexOf(const Eigen::Vector2i& pixel) const { return pixel.y() * width_ + pixel.x(); }
  bool FindMatch(int candidate);

  int width_, height_;
  std::vector<Eigen::Vector2i> reach_;  // offsets within the distance, nearest first
  std::vector<int> candidate_of_;       // of each pixel that is a target: kFree or its match
  std::vector<int> target_of_;          // of each pixel that is a candidate
  std::vector<int> reached_from_;       // the candidate from which a search reached a target
  std::vector<uint32_t> search_of_;     // number of the search that reached a target last
  std::vector<int> queue_, reached_;    // work space of a search
  uint32_t search_ = 0;
  size_t num_targets_ = 0, num_candidates_ = 0, num_matches_ = 0;
};

}  // namespace plumb::tools
