// The most one-to-one matches between two sets of nearby pixels.
#include "tools/metrics/pixel_matcher.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace plumb::tools {
namespace {

constexpr int kAbsent = -2;  // the pixel is not in the set
constexpr int kFree = -1;    // it is, without a match
// No search may visit this target again.
constexpr uint32_t kExhausted = std::numeric_limits<uint32_t>::max();

}  // namespace

PixelMatcher::PixelMatcher(int width_px, int height_px, double max_distance_px)
    : width_(width_px), height_(height_px) {
  const auto pixels = static_cast<size_t>(width_px) * static_cast<size_t>(height_px);
  candidate_of_.assign(pixels, kAbsent);
  target_of_.assign(pixels, kAbsent);
  reached_from_.assign(pixels, 0);
  search_of_.assign(pixels, 0);
  const int radius = static_cast<int>(std::floor(max_distance_px));
  for (int y = -radius; y <= radius; ++y) {
    for (int x = -radius; x <= radius; ++x) {
      if (x * x + y * y <= max_distance_px * max_distance_px) reach_.emplace_back(x, y);
    }
  }
  std::stable_sort(reach_.begin(), reach_.end(),
                   [](const Eigen::Vector2i& a, const Eigen::Vector2i& b) {
                     return a.squaredNorm() < b.squaredNorm();
                   });
}

void PixelMatcher::AddTarget(const Eigen::Vector2i& pixel) {
  int& match = candidate_of_[IndexOf(pixel)];
  if (match != kAbsent) return;
  match = kFree;
  ++num_targets_;
}

void PixelMatcher::AddCandidate(const Eigen::Vector2i& pixel) {
  const int index = IndexOf(pixel);
  if (target_of_[index] != kAbsent) return;
  target_of_[index] = kFree;
  ++num_candidates_;
  if (FindMatch(index)) ++num_matches_;
}

// Breadth-first search for the shortest alternating path from a new candidate to a free target.
bool PixelMatcher::FindMatch(int candidate) {
  ++search_;
  queue_.assign(1, candidate);
  reached_.clear();
  for (size_t head = 0; head < queue_.size(); ++head) {
    const int from = queue_[head];
    const Eigen::Vector2i pixel(from % width_, from / width_);
    for (const Eigen::Vector2i& offset : reach_) {
      const Eigen::Vector2i near = pixel + offset;
      if (near.x() < 0 || near.y() < 0 || near.x() >= width_ || near.y() >= height_) continue;
      const int target = IndexOf(near);
      if (candidate_of_[target] == kAbsent || search_of_[target] >= search_) continue;
      search_of_[target] = search_;
      reached_from_[target] = from;
      if (candidate_of_[target] != kFree) {
        reached_.push_back(target);
        queue_.push_back(candidate_of_[target]);
        continue;
      }
      // Every candidate on the path moves on to the target that it reached.
      for (int free = target; free >= 0;) {
        const int taker = reached_from_[free];
        const int left = target_of_[taker];
        candidate_of_[free] = taker;
        target_of_[taker] = free;
        free = left;
      }
      return true;
    }
  }
  // What this search reached leads to no free target, and candidates added later do not change
  // that: they give these targets' candidates no new neighbours.
  for (const int target : reached_) search_of_[target] = kExhausted;
  return false;
}

}  // namespace plumb::tools
