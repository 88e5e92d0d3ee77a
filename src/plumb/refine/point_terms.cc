#include "plumb/refine/point_terms.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "plumb/base/simd_clones.h"
#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr double kPixelSigma = 0.7;
constexpr double kMedianOfChiSquare2 = 1.386;
constexpr double kMinPointScale = 0.09;
constexpr double kPointRobustSigmas = 3.0;

struct View {
  float r[9], t[3];
  float fx, fy, cx, cy, near;
};

View ViewOf(const Camera& camera, const Rigid3& relative) {
  View view;
  const Eigen::Matrix3d rotation = relative.RotationMatrix();
  for (int i = 0; i < 9; ++i) view.r[i] = static_cast<float>(rotation(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) view.t[i] = static_cast<float>(relative.translation[i]);
  view.fx = static_cast<float>(camera.fx);
  view.fy = static_cast<float>(camera.fy);
  view.cx = static_cast<float>(camera.cx);
  view.cy = static_cast<float>(camera.cy);
  view.near = static_cast<float>(kNearPlane);
  return view;
}

/// Whitened residuals and Jacobians. The covariance sigma^2 I + j j^T has the whitening
/// (I - (1 - sigma / sqrt(sigma^2 + |j|^2)) j j^T / |j|^2) / sigma.
/// `square` is negative for points that are too near.
PLUMB_SIMD_CLONES void PointKernel(size_t count, const View view, const float* __restrict px_u,
                                   const float* __restrict px_v, const float* __restrict in_x,
                                   const float* __restrict in_y, const float* __restrict in_z,
                                   const float* __restrict in_dx, const float* __restrict in_dy,
                                   const float* __restrict in_dz, float* __restrict square,
                                   float* __restrict plain, float* __restrict residual_u,
                                   float* __restrict residual_v, float* __restrict u0,
                                   float* __restrict u1, float* __restrict u2, float* __restrict u3,
                                   float* __restrict u4, float* __restrict u5, float* __restrict v0,
                                   float* __restrict v1, float* __restrict v2, float* __restrict v3,
                                   float* __restrict v4, float* __restrict v5) {
  constexpr float kSigma = static_cast<float>(kPixelSigma);
  const float r0 = view.r[0], r1 = view.r[1], r2 = view.r[2], r3 = view.r[3], r4 = view.r[4];
  const float r5 = view.r[5], r6 = view.r[6], r7 = view.r[7], r8 = view.r[8];
  const float t0 = view.t[0], t1 = view.t[1], t2 = view.t[2], fx = view.fx, fy = view.fy;
  const float cx = view.cx, cy = view.cy, near = view.near;
  for (size_t k = 0; k < count; ++k) {
    const float qx = in_x[k], qy = in_y[k], qz = in_z[k];
    const float z = r6 * qx + r7 * qy + r8 * qz + t2;
    const bool usable = z > near;
    const float iz = 1.0f / std::max(z, near);
    const float x = (r0 * qx + r1 * qy + r2 * qz + t0) * iz;
    const float y = (r3 * qx + r4 * qy + r5 * qz + t1) * iz;
    const float eu = fx * x + cx - px_u[k], ev = fy * y + cy - px_v[k];
    const float dx = in_dx[k], dy = in_dy[k], dz = in_dz[k];
    const float turned_z = r6 * dx + r7 * dy + r8 * dz;
    const float ju = fx * (r0 * dx + r1 * dy + r2 * dz - x * turned_z) * iz;
    const float jv = fy * (r3 * dx + r4 * dy + r5 * dz - y * turned_z) * iz;
    const float norm = ju * ju + jv * jv;
    // (1 - sigma / sqrt(sigma^2 + n)) / n without cancellation.
    const float root = std::sqrt(kSigma * kSigma + norm);
    const float shrink = 1.0f / (root * (root + kSigma));
    // Rows of the whitening matrix.
    const float a = (1.0f - shrink * ju * ju) / kSigma, b = -shrink * ju * jv / kSigma;
    const float c = (1.0f - shrink * jv * jv) / kSigma;
    const float wu = a * eu + b * ev, wv = b * eu + c * ev;
    square[k] = usable ? wu * wu + wv * wv : -1.0f;
    plain[k] = usable ? eu * eu + ev * ev : 3.0e38f;
    residual_u[k] = wu;
    residual_v[k] = wv;
    const float g0 = -fx * x * y, g1 = fx * (1.0f + x * x), g2 = -fx * y, g3 = fx * iz;
    const float g5 = -fx * x * iz;
    const float h0 = -fy * (1.0f + y * y), h1 = fy * x * y, h2 = fy * x, h4 = fy * iz;
    const float h5 = -fy * y * iz;
    u0[k] = a * g0 + b * h0;
    u1[k] = a * g1 + b * h1;
    u2[k] = a * g2 + b * h2;
    u3[k] = a * g3;
    u4[k] = b * h4;
    u5[k] = a * g5 + b * h5;
    v0[k] = b * g0 + c * h0;
    v1[k] = b * g1 + c * h1;
    v2[k] = b * g2 + c * h2;
    v3[k] = b * g3;
    v4[k] = c * h4;
    v5[k] = b * g5 + c * h5;
  }
}

PLUMB_SIMD_CLONES void PointWeightKernel(size_t count, float inverse_scale, float inverse_bound,
                                         const float* __restrict square,
                                         const float* __restrict share, float* __restrict weight_u,
                                         float* __restrict weight_v) {
  for (size_t k = 0; k < count; ++k) {
    const float q = 1.0f / (1.0f + std::max(square[k], 0.0f) * inverse_bound);
    const float weight = square[k] >= 0.0f ? inverse_scale * share[k] * q * q : 0.0f;
    weight_u[k] = weight;
    weight_v[k] = weight;
  }
}

PLUMB_SIMD_CLONES int32_t CountBelow(size_t count, int32_t bound, const int32_t* __restrict bits) {
  int32_t below = 0;
  for (size_t k = 0; k < count; ++k) below += bits[k] < bound;
  return below;
}

/// The element that std::nth_element() puts in the middle. Numbers that are not negative order as
/// their bits do, so that the answer is found bit by bit, by counting and without a branch that
/// depends on the numbers.
float UpperMedian(const std::vector<float>& values, std::vector<int32_t>* bits) {
  bits->resize(values.size());
  std::memcpy(bits->data(), values.data(), values.size() * sizeof(float));
  const auto rank = static_cast<int32_t>(values.size() / 2);
  int32_t found = 0;
  for (int bit = 30; bit >= 0; --bit) {
    const int32_t next = found | (1 << bit);
    if (CountBelow(bits->size(), next, bits->data()) <= rank) found = next;
  }
  return std::bit_cast<float>(found);
}

}  // namespace

void PointTable::Assign(std::span<const PointObservation> points, const Rigid3& reference) {
  reference_from_world = reference;
  for (std::vector<float>* column :
       {&u, &v, &x, &y, &z, &deviation_x, &deviation_y, &deviation_z, &weight}) {
    column->resize(points.size());
  }
  const Eigen::Matrix3d rotation = reference.RotationMatrix();
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3f p =
        (rotation * points[i].point_in_world + reference.translation).cast<float>();
    const Eigen::Vector3f d = (rotation * points[i].deviation_in_world).cast<float>();
    u[i] = static_cast<float>(points[i].pixel.x());
    v[i] = static_cast<float>(points[i].pixel.y());
    x[i] = p.x();
    y[i] = p.y();
    z[i] = p.z();
    deviation_x[i] = d.x();
    deviation_y[i] = d.y();
    deviation_z[i] = d.z();
    weight[i] = static_cast<float>(points[i].weight);
  }
}

void PointTable::AssignRows(const PointTable& other, std::span<const uint32_t> kept) {
  reference_from_world = other.reference_from_world;
  const auto copy = [&](const std::vector<float>& in, std::vector<float>* out) {
    out->resize(kept.size());
    for (size_t i = 0; i < kept.size(); ++i) (*out)[i] = in[kept[i]];
  };
  copy(other.u, &u);
  copy(other.v, &v);
  copy(other.x, &x);
  copy(other.y, &y);
  copy(other.z, &z);
  copy(other.deviation_x, &deviation_x);
  copy(other.deviation_y, &deviation_y);
  copy(other.deviation_z, &deviation_z);
  copy(other.weight, &weight);
}

size_t PointTable::ShareWeights() {
  order_.resize(size());
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(),
            [&](uint32_t a, uint32_t b) { return u[a] != u[b] ? u[a] < u[b] : v[a] < v[b]; });
  size_t num_pixels = 0;
  for (size_t begin = 0, end = 0; begin < order_.size(); begin = end, ++num_pixels) {
    const uint32_t first = order_[begin];
    while (end < order_.size() && u[order_[end]] == u[first] && v[order_[end]] == v[first]) ++end;
    for (size_t i = begin; i < end; ++i) weight[order_[i]] = 1.0f / static_cast<float>(end - begin);
  }
  return num_pixels;
}

void PointTableAccumulator::Evaluate(const Camera& camera, const Rigid3& cam_from_world,
                                     const PointTable& points) {
  const size_t count = points.size();
  rows_.Resize(2 * count);
  square_.resize(count);
  plain_square_.resize(count);
  const auto u = [&](size_t i) { return rows_.jacobian[i].data(); };
  const auto v = [&](size_t i) { return rows_.jacobian[i].data() + count; };
  PointKernel(count, ViewOf(camera, cam_from_world * points.reference_from_world.Inverse()),
              points.u.data(), points.v.data(), points.x.data(), points.y.data(), points.z.data(),
              points.deviation_x.data(), points.deviation_y.data(), points.deviation_z.data(),
              square_.data(), plain_square_.data(), rows_.residual.data(),
              rows_.residual.data() + count, u(0), u(1), u(2), u(3), u(4), u(5), v(0), v(1), v(2),
              v(3), v(4), v(5));
}

PointAccumulator::Equations PointTableAccumulator::Accumulate(const Camera& camera,
                                                              const Rigid3& cam_from_world,
                                                              const PointTable& points,
                                                              double scale) {
  Evaluate(camera, cam_from_world, points);
  usable_.clear();
  for (const float square : square_) {
    if (square >= 0.0f) usable_.push_back(square);
  }
  PointAccumulator::Equations out;
  if (usable_.empty()) return out;
  if (scale <= 0.0) {
    const auto median = static_cast<double>(UpperMedian(usable_, &bits_));
    scale = std::max(median / kMedianOfChiSquare2, kMinPointScale);
  }
  const size_t count = points.size();
  PointWeightKernel(count, static_cast<float>(1.0 / scale),
                    static_cast<float>(1.0 / (scale * kPointRobustSigmas * kPointRobustSigmas)),
                    square_.data(), points.weight.data(), rows_.weight.data(),
                    rows_.weight.data() + count);
  out.equations = SumRows(rows_);
  out.num_points = static_cast<int>(usable_.size());
  out.scale = scale;
  return out;
}

void PointTableAccumulator::FindNear(const Camera& camera, const Rigid3& cam_from_world,
                                     const PointTable& points, double max_px,
                                     std::vector<uint32_t>* out_rows) {
  Evaluate(camera, cam_from_world, points);
  const float limit = static_cast<float>(max_px * max_px);
  out_rows->clear();
  for (uint32_t k = 0; k < plain_square_.size(); ++k) {
    if (plain_square_[k] < limit) out_rows->push_back(k);
  }
}

}  // namespace plumb
