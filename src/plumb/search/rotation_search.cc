#include "plumb/search/rotation_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "plumb/base/simd_clones.h"
#include "plumb/geometry/rigid3.h"

namespace plumb {
namespace {

constexpr double kLengthCapPx = 150.0;
constexpr double kDegree = std::numbers::pi / 180.0;
// A biweight of this half width has about the shape of a Gaussian of 1.5 deg.
constexpr double kHalfWidth = 2.6 * 1.5 * kDegree;

PLUMB_SIMD_CLONES void BestDirectionKernel(size_t count, float dx, float dy, float dz, float weight,
                                           float inverse_square_width, const float* __restrict nx,
                                           const float* __restrict ny, const float* __restrict nz,
                                           float* __restrict best) {
  for (size_t k = 0; k < count; ++k) {
    const float sine = nx[k] * dx + ny[k] * dy + nz[k] * dz;
    const float q = std::max(1.0f - sine * sine * inverse_square_width, 0.0f);
    best[k] = std::max(best[k], weight * q * q);
  }
}

PLUMB_SIMD_CLONES float WeightedSum(size_t count, const float* __restrict a,
                                    const float* __restrict b) {
  float sum = 0.0f;
  for (size_t k = 0; k < count; ++k) sum += a[k] * b[k];
  return sum;
}

}  // namespace

Eigen::Matrix3f RotationFromVector(const Eigen::Vector3f& w) {
  return ExpSo3(w.cast<double>()).toRotationMatrix().cast<float>();
}

float RotationSearch::Score(const Eigen::Matrix3f& rotation,
                            std::span<const DirectionCluster> clusters) {
  static const float kInverseSquareWidth =
      static_cast<float>(1.0 / (std::sin(kHalfWidth) * std::sin(kHalfWidth)));
  std::fill(best_.begin(), best_.end(), 0.0f);
  for (const DirectionCluster& cluster : clusters) {
    const Eigen::Vector3f d = rotation * cluster.direction;
    BestDirectionKernel(best_.size(), d.x(), d.y(), d.z(), std::min(1.0f, 3.0f * cluster.weight),
                        kInverseSquareWidth, normal_x_.data(), normal_y_.data(), normal_z_.data(),
                        best_.data());
  }
  return WeightedSum(best_.size(), best_.data(), length_.data());
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
  best_.resize(length_.size());

  const float sigma = static_cast<float>(options.rotation_sigma_rad / std::sqrt(3.0));
  draws_.clear();
  order_.clear();
  for (uint32_t k = 0; k < options.num_draws; ++k) {
    const Eigen::Vector3f w = random->Normal3(sigma);
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
