#include "plumb/search/rotation_search.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include <Eigen/Geometry>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr size_t kLanes = 8, kMaxDirections = 16;
constexpr double kLengthCapPx = 150.0;
constexpr double kDegree = std::numbers::pi / 180.0;
// A biweight of this half width has about the shape of a Gaussian of 1.5 deg.
constexpr double kHalfWidth = 2.6 * 1.5 * kDegree;

struct Direction {
  float x, y, z, weight;
};

// Eight floats as one register, or two where there is none so wide.
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));

PLUMB_SIMD_CLONES float ScoreKernel(size_t count, const Direction* directions,
                                    size_t num_directions, float inverse_square_width,
                                    const float* nx, const float* ny, const float* nz,
                                    const float* length) {
  const Lanes zero = {};
  Lanes sums = {};
  for (size_t k = 0; k < count; k += kLanes) {
    Lanes x, y, z, pixels;
    std::memcpy(&x, nx + k, sizeof(x));
    std::memcpy(&y, ny + k, sizeof(y));
    std::memcpy(&z, nz + k, sizeof(z));
    std::memcpy(&pixels, length + k, sizeof(pixels));
    Lanes best = {};
    for (size_t d = 0; d < num_directions; ++d) {
      const Direction& to = directions[d];
      const Lanes sine = x * to.x + y * to.y + z * to.z;
      Lanes q = 1.0f - sine * sine * inverse_square_width;
      q = q > zero ? q : zero;
      const Lanes value = q * q * to.weight;
      best = value > best ? value : best;
    }
    sums += best * pixels;
  }
  return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}

}  // namespace

Eigen::Matrix3f RotationFromVector(const Eigen::Vector3f& w) {
  return Eigen::Quaternionf(1.0f, 0.5f * w.x(), 0.5f * w.y(), 0.5f * w.z())
      .normalized()
      .toRotationMatrix();
}

Eigen::Vector3f Draw(const RotationSpread& spread, Random* random) {
  const Eigen::Vector3f w = random->Normal3(spread.sigma_rad);
  if (spread.axis.isZero()) return w;
  const Eigen::Vector3f about = w.dot(spread.axis) * spread.axis;
  return about + spread.tilt_sigma_rad / spread.sigma_rad * (w - about);
}

float RotationSearch::Score(const Eigen::Matrix3f& rotation,
                            std::span<const DirectionCluster> clusters) {
  static const float kInverseSquareWidth =
      static_cast<float>(1.0 / (std::sin(kHalfWidth) * std::sin(kHalfWidth)));
  Direction directions[kMaxDirections];
  const size_t count = std::min(clusters.size(), kMaxDirections);
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3f d = rotation * clusters[i].direction;
    directions[i] = {d.x(), d.y(), d.z(), std::min(1.0f, 3.0f * clusters[i].weight)};
  }
  return ScoreKernel(length_.size(), directions, count, kInverseSquareWidth, normal_x_.data(),
                     normal_y_.data(), normal_z_.data(), length_.data());
}

void RotationSearch::Search(const Camera& camera, std::span<const Segment2> segments,
                            std::span<const DirectionCluster> clusters,
                            const RotationSearchOptions& options, Random* random,
                            std::vector<Eigen::Matrix3f>* out_rotations) {
  for (std::vector<float>* column : {&normal_x_, &normal_y_, &normal_z_, &length_}) column->clear();
  for (const Segment2& segment : segments) {
    const Eigen::Vector3d normal = camera.Normalize(segment.start)
                                       .homogeneous()
                                       .cross(camera.Normalize(segment.end).homogeneous());
    const double norm = normal.norm();
    if (!(norm > 0.0)) continue;
    normal_x_.push_back(static_cast<float>(normal.x() / norm));
    normal_y_.push_back(static_cast<float>(normal.y() / norm));
    normal_z_.push_back(static_cast<float>(normal.z() / norm));
    length_.push_back(static_cast<float>(std::min(segment.Length(), kLengthCapPx)));
  }
  while (length_.size() % kLanes != 0) {  // padding counts for nothing
    for (std::vector<float>* column : {&normal_x_, &normal_y_, &normal_z_, &length_}) {
      column->push_back(0.0f);
    }
  }

  draws_.clear();
  order_.clear();
  for (uint32_t k = 0; k < options.num_draws; ++k) {
    const Eigen::Vector3f w = plumb::Draw(options.spread, random);
    Draw draw;
    draw.rotation = RotationFromVector(k == 0 ? Eigen::Vector3f(Eigen::Vector3f::Zero()) : w);
    draw.score = Score(draw.rotation, clusters);
    draws_.push_back(draw);
    order_.push_back(k);
  }
  const size_t kept = std::min(options.num_kept, draws_.size());
  std::partial_sort(order_.begin(), order_.begin() + static_cast<ptrdiff_t>(kept), order_.end(),
                    [&](uint32_t a, uint32_t b) {
                      return draws_[a].score != draws_[b].score ? draws_[a].score > draws_[b].score
                                                                : a < b;
                    });
  out_rotations->clear();
  for (size_t k = 0; k < kept; ++k) out_rotations->push_back(draws_[order_[k]].rotation);
}

}  // namespace plumb
