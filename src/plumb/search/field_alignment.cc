#include "plumb/search/field_alignment.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "plumb/base/simd_clones.h"
#include "plumb/geometry/rigid3.h"

namespace plumb {
namespace {

constexpr double kMaxRotationStep = 0.08;
constexpr double kDamping = 1e-3;
// Samples within half a pixel of the truncation see no segment.
constexpr float kMaxDistancePx = DirectionField::kTruncationPx - 0.5f;

PLUMB_SIMD_CLONES void JacobianKernel(
    size_t count, float fx, float fy, float inverse_sigma, float scale, const float* __restrict x,
    const float* __restrict y, const float* __restrict iz, const float* __restrict distance,
    const float* __restrict gradient_x, const float* __restrict gradient_y,
    float* __restrict weight, float* __restrict j0, float* __restrict j1, float* __restrict j2,
    float* __restrict j3, float* __restrict j4, float* __restrict j5) {
  for (size_t k = 0; k < count; ++k) {
    const float gu = gradient_x[k] * fx, gv = gradient_y[k] * fy;
    const float u = x[k], v = y[k], inverse = iz[k];
    const float radial = gu * u + gv * v;
    j0[k] = -v * radial - gv;
    j1[k] = u * radial + gu;
    j2[k] = gv * u - gu * v;
    j3[k] = gu * inverse;
    j4[k] = gv * inverse;
    j5[k] = -radial * inverse;
    const float r = distance[k] * inverse_sigma;
    const float q = 1.0f / (1.0f + r * r);
    weight[k] = distance[k] < kMaxDistancePx ? weight[k] * scale * q * q : 0.0f;
  }
}

PLUMB_SIMD_CLONES void Multiply(size_t count, const float* __restrict a, const float* __restrict b,
                                float* __restrict product) {
  for (size_t k = 0; k < count; ++k) product[k] = a[k] * b[k];
}

PLUMB_SIMD_CLONES float Dot(size_t count, const float* __restrict a, const float* __restrict b) {
  float sum = 0.0f;
  for (size_t k = 0; k < count; ++k) sum += a[k] * b[k];
  return sum;
}

}  // namespace

RelativePose FieldAligner::Align(const Camera& camera, const DirectionField& field,
                                 const LineSamples& samples, const RelativePose& start,
                                 const FieldAlignmentOptions& options) {
  const size_t count = samples.padded_size();
  lookups_.Resize(count);
  for (std::vector<float>* column : {&distance_, &gradient_x_, &gradient_y_, &weighted_}) {
    column->resize(count);
  }
  for (std::vector<float>& column : jacobian_) column.resize(count);
  const float inverse_sigma = static_cast<float>(1.0 / options.sigma_px);
  const float scale = static_cast<float>(samples.count) * inverse_sigma * inverse_sigma;
  const float unit = field.unit_px();
  // A byte's difference over two cells, in pixels per pixel.
  const float slope = unit / (2.0f * static_cast<float>(field.cell_px()));
  const ptrdiff_t row = static_cast<ptrdiff_t>(field.width()) * DirectionField::kChannels;
  Vector6d prior;
  prior << Eigen::Vector3d::Constant(std::pow(options.prior_rotation_sigma_rad, -2)),
      Eigen::Vector3d::Constant(std::pow(options.prior_position_sigma_m, -2));

  RelativePose pose = start;
  for (int step = 0; step < options.num_steps; ++step) {
    LookUp(camera, field, pose, samples, &lookups_);
    const uint8_t* const bytes = field.data();
    for (size_t k = 0; k < count; ++k) {
      const uint8_t* const p = bytes + lookups_.index[k];
      distance_[k] = unit * static_cast<float>(*p);
      gradient_x_[k] =
          slope * static_cast<float>(p[DirectionField::kChannels] - p[-DirectionField::kChannels]);
      gradient_y_[k] = slope * static_cast<float>(p[row] - p[-row]);
    }
    JacobianKernel(count, static_cast<float>(camera.fx), static_cast<float>(camera.fy),
                   inverse_sigma, scale, lookups_.x.data(), lookups_.y.data(),
                   lookups_.inverse_depth.data(), distance_.data(), gradient_x_.data(),
                   gradient_y_.data(), lookups_.weight.data(), jacobian_[0].data(),
                   jacobian_[1].data(), jacobian_[2].data(), jacobian_[3].data(),
                   jacobian_[4].data(), jacobian_[5].data());
    Matrix6d information;
    Vector6d gradient;
    for (int i = 0; i < 6; ++i) {
      Multiply(count, jacobian_[i].data(), lookups_.weight.data(), weighted_.data());
      for (int j = i; j < 6; ++j) {
        information(j, i) = Dot(count, weighted_.data(), jacobian_[j].data());
      }
      gradient[i] = Dot(count, weighted_.data(), distance_.data());
    }
    const Rigid3 current = pose.After(Rigid3{});
    gradient += prior.cwiseProduct(Difference(current, Rigid3{}));
    information.diagonal() += (prior.array() + kDamping).matrix();
    const Eigen::LLT<Matrix6d> cholesky(information.selfadjointView<Eigen::Lower>());
    if (cholesky.info() != Eigen::Success) break;
    Vector6d delta = -cholesky.solve(gradient);
    if (!delta.allFinite()) break;
    const double angle = delta.head<3>().norm();
    if (angle > kMaxRotationStep) delta *= kMaxRotationStep / angle;
    const Rigid3 next = Perturb(current, delta);
    pose.rotation = next.RotationMatrix().cast<float>();
    pose.translation = next.translation.cast<float>();
  }
  return pose;
}

}  // namespace plumb
