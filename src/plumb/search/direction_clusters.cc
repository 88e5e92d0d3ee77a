#include "plumb/search/direction_clusters.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kRadius = 5.0f * kPi / 180.0f;
constexpr double kMaxLength = 1.0;  // [m]

float MinCosine() {
  static const float kMinCosine = std::cos(kRadius);
  return kMinCosine;
}

PLUMB_SIMD_CLONES void AddNearKernel(size_t count, float cx, float cy, float cz, float min_cosine,
                                     float weight, const float* __restrict x,
                                     const float* __restrict y, const float* __restrict z,
                                     float* __restrict neighbourhood) {
  for (size_t k = 0; k < count; ++k) {
    const float cosine = std::abs(cx * x[k] + cy * y[k] + cz * z[k]);
    neighbourhood[k] += cosine > min_cosine ? weight : 0.0f;
  }
}

}  // namespace

void DirectionClusterer::AddNear(size_t center, float weight) {
  AddNearKernel(x_.size(), x_[center], y_[center], z_[center], MinCosine(), weight, x_.data(),
                y_.data(), z_.data(), neighbourhood_.data());
}

void DirectionClusterer::Cluster(std::span<const SearchLine> lines, size_t max_clusters,
                                 std::vector<DirectionCluster>* out) {
  out->clear();
  for (std::vector<float>* column : {&x_, &y_, &z_, &weights_}) column->clear();
  for (const SearchLine& line : lines) {
    const double length = line.segment_in_world.Length();
    if (!(length > 0.0)) continue;
    const Eigen::Vector3f direction = (line.segment_in_world.Delta() / length).cast<float>();
    x_.push_back(direction.x());
    y_.push_back(direction.y());
    z_.push_back(direction.z());
    weights_.push_back(static_cast<float>(line.weight * std::min(length, kMaxLength)));
  }
  const size_t count = weights_.size();
  const auto direction = [&](size_t i) { return Eigen::Vector3f(x_[i], y_[i], z_[i]); };
  neighbourhood_.assign(count, 0.0f);
  for (size_t i = 0; i < count; ++i) AddNear(i, weights_[i]);
  taken_.assign(count, 0);
  while (out->size() < max_clusters) {
    size_t best = count;
    for (size_t i = 0; i < count; ++i) {
      if (!taken_[i] && (best == count || neighbourhood_[i] > neighbourhood_[best])) best = i;
    }
    if (best == count) break;
    const Eigen::Vector3f center = direction(best);
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float weight = 0.0f;
    for (size_t j = 0; j < count; ++j) {
      const float cosine = center.dot(direction(j));
      // A line is near itself, whatever rounding makes of it.
      if (taken_[j] || !(std::abs(cosine) > MinCosine() || j == best)) continue;
      taken_[j] = 1;
      sum += (cosine < 0.0f ? -weights_[j] : weights_[j]) * direction(j);
      weight += weights_[j];
      AddNear(j, -weights_[j]);
    }
    out->push_back({sum.normalized(), weight});
  }
  float heaviest = 0.0f;
  for (const DirectionCluster& cluster : *out) heaviest = std::max(heaviest, cluster.weight);
  for (DirectionCluster& cluster : *out) cluster.weight /= heaviest;
}

}  // namespace plumb
