#include "plumb/search/direction_clusters.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace plumb {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kRadius = 5.0f * kPi / 180.0f;
constexpr double kMaxLength = 1.0;  // [m]

}  // namespace

void DirectionClusterer::Cluster(std::span<const SearchLine> lines, size_t max_clusters,
                                 std::vector<DirectionCluster>* out) {
  out->clear();
  directions_.clear();
  weights_.clear();
  for (const SearchLine& line : lines) {
    const double length = line.segment_in_world.Length();
    if (!(length > 0.0)) continue;
    directions_.push_back((line.segment_in_world.Delta() / length).cast<float>());
    weights_.push_back(static_cast<float>(line.weight * std::min(length, kMaxLength)));
  }
  const size_t count = directions_.size();
  const float min_cosine = std::cos(kRadius);
  const auto is_near = [&](size_t i, size_t j) {
    return std::abs(directions_[i].dot(directions_[j])) > min_cosine;
  };
  neighbourhood_.assign(weights_.begin(), weights_.end());
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count; ++j) {
      if (!is_near(i, j)) continue;
      neighbourhood_[i] += weights_[j];
      neighbourhood_[j] += weights_[i];
    }
  }
  taken_.assign(count, 0);
  while (out->size() < max_clusters) {
    size_t best = count;
    for (size_t i = 0; i < count; ++i) {
      if (!taken_[i] && (best == count || neighbourhood_[i] > neighbourhood_[best])) best = i;
    }
    if (best == count) break;
    const Eigen::Vector3f center = directions_[best];
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float weight = 0.0f;
    for (size_t j = 0; j < count; ++j) {
      if (taken_[j] || !is_near(best, j)) continue;
      taken_[j] = 1;
      sum += (center.dot(directions_[j]) < 0.0f ? -weights_[j] : weights_[j]) * directions_[j];
      weight += weights_[j];
      for (size_t i = 0; i < count; ++i) {
        if (is_near(i, j)) neighbourhood_[i] -= weights_[j];
      }
    }
    out->push_back({sum.normalized(), weight});
  }
  float heaviest = 0.0f;
  for (const DirectionCluster& cluster : *out) heaviest = std::max(heaviest, cluster.weight);
  for (DirectionCluster& cluster : *out) cluster.weight /= heaviest;
}

}  // namespace plumb
