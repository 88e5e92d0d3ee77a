#include "plumb/search/field_alignment.h"

#include <algorithm>
#include <cmath>

#include "plumb/base/simd_clones.h"
#include "plumb/base/solve6.h"
#include "plumb/base/weighted_products.h"
#include "plumb/geometry/rigid3.h"

namespace plumb {
namespace {

constexpr double kMaxRotationStep = 0.08;
constexpr double kDamping = 1e-3;
// A step that moves the image, at this depth, by so small a share of sigma is the last of its
// level.
constexpr double kUsualDepthM = 2.0, kConvergedShare = 0.05;
// Samples within half a pixel of the truncation see no segment.
constexpr float kMaxDistancePx = DirectionField::kTruncationPx - 0.5f;

/// How samples lie among the cells, as LookUp() rounds them, and what bytes stand for.
struct CellGrid {
  float fx, fy, cx, cy, cell_px;
  float unit, slope;  // pixels per byte; pixels per pixel of a byte's difference over two cells
};

PLUMB_SIMD_CLONES void JacobianKernel(
    size_t count, float fx, float fy, const CellGrid grid, float inverse_sigma, float scale,
    const float* __restrict x, const float* __restrict y, const float* __restrict iz,
    const int32_t* __restrict center, const int32_t* __restrict across,
    const int32_t* __restrict down, float* __restrict distance, float* __restrict weight,
    float* __restrict j0, float* __restrict j1, float* __restrict j2, float* __restrict j3,
    float* __restrict j4, float* __restrict j5) {
  for (size_t k = 0; k < count; ++k) {
    const float gradient_x = grid.slope * static_cast<float>(across[k]);
    const float gradient_y = grid.slope * static_cast<float>(down[k]);
    const float gu = gradient_x * fx, gv = gradient_y * fy;
    const float u = x[k], v = y[k], inverse = iz[k];
    const float radial = gu * u + gv * v;
    j0[k] = -v * radial - gv;
    j1[k] = u * radial + gu;
    j2[k] = gv * u - gu * v;
    j3[k] = gu * inverse;
    j4[k] = gv * inverse;
    j5[k] = -radial * inverse;
    // From the cell's centre to the sample.
    const float column = grid.fx * u + grid.cx, row = grid.fy * v + grid.cy;
    const float dx = column - static_cast<float>(static_cast<int32_t>(column)) - 0.5f;
    const float dy = row - static_cast<float>(static_cast<int32_t>(row)) - 0.5f;
    const float at_center = grid.unit * static_cast<float>(center[k]);
    const float d = std::max(at_center + (gradient_x * dx + gradient_y * dy) * grid.cell_px, 0.0f);
    distance[k] = d;
    const float r = d * inverse_sigma;
    const float q = 1.0f / (1.0f + r * r);
    weight[k] = at_center < kMaxDistancePx ? weight[k] * scale * q * q : 0.0f;
  }
}

}  // namespace

RelativePose FieldAligner::Align(const Camera& camera, const DirectionField& field,
                                 const LineSamples& samples, const RelativePose& start,
                                 const FieldAlignmentOptions& options) {
  const size_t count = samples.num_slots;
  distance_.resize(count);
  for (std::vector<int32_t>* column : {&center_, &across_, &down_}) column->resize(count);
  for (std::vector<float>& column : jacobian_) column.resize(count);
  const float inverse_sigma = static_cast<float>(1.0 / options.sigma_px);
  const float scale = static_cast<float>(samples.count) * inverse_sigma * inverse_sigma;
  const float unit = field.unit_px();
  const ptrdiff_t row = static_cast<ptrdiff_t>(field.width()) * DirectionField::kChannels;
  const double cells = 1.0 / field.cell_px();
  const CellGrid grid{static_cast<float>(camera.fx * cells),
                      static_cast<float>(camera.fy * cells),
                      static_cast<float>(camera.cx * cells + field.border_cells() + 0.5),
                      static_cast<float>(camera.cy * cells + field.border_cells() + 0.5),
                      static_cast<float>(field.cell_px()),
                      unit,
                      unit / (2.0f * static_cast<float>(field.cell_px()))};
  Vector6d prior;
  prior << Eigen::Vector3d::Constant(std::pow(options.prior_rotation_sigma_rad, -2)),
      Eigen::Vector3d::Constant(std::pow(options.prior_position_sigma_m, -2));

  RelativePose pose = start;
  Rigid3 current = start.After(Rigid3{});
  for (int step = 0; step < options.num_steps; ++step) {
    LookUp(camera, field, pose, samples, &lookups_);
    const uint8_t* const bytes = field.data();
    for (size_t k = 0; k < count; ++k) {
      const uint8_t* const p = bytes + lookups_.index[k];
      center_[k] = *p;
      across_[k] = p[DirectionField::kChannels] - p[-DirectionField::kChannels];
      down_[k] = p[row] - p[-row];
    }
    JacobianKernel(count, static_cast<float>(camera.fx), static_cast<float>(camera.fy), grid,
                   inverse_sigma, scale, lookups_.x.data(), lookups_.y.data(),
                   lookups_.inverse_depth.data(), center_.data(), across_.data(), down_.data(),
                   distance_.data(), lookups_.weight.data(), jacobian_[0].data(),
                   jacobian_[1].data(), jacobian_[2].data(), jacobian_[3].data(),
                   jacobian_[4].data(), jacobian_[5].data());
    LeastSquaresColumns columns;
    for (size_t i = 0; i < 6; ++i) columns[i] = jacobian_[i].data();
    columns[6] = distance_.data();
    float sums[6][7];
    SumWeightedProducts(count, columns, lookups_.weight.data(), sums);
    const Vector6d off = prior.cwiseProduct(Difference(current, Rigid3{}));
    Matrix6d information;
    Vector6d gradient, delta;
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) information(j, i) = static_cast<double>(sums[i][j]);
      information(i, i) += prior[i] + kDamping;
      gradient[i] = -(static_cast<double>(sums[i][6]) + off[i]);
    }
    if (!SolvePositive6(information.data(), gradient.data(), delta.data())) break;
    if (!delta.allFinite()) break;
    const double angle = delta.head<3>().norm();
    if (angle > kMaxRotationStep) delta *= kMaxRotationStep / angle;
    current = Perturb(current, delta);
    pose.rotation = current.RotationMatrix().cast<float>();
    pose.translation = current.translation.cast<float>();
    const double moved_px =
        camera.MeanFocal() * (delta.head<3>().norm() + delta.tail<3>().norm() / kUsualDepthM);
    if (moved_px < kConvergedShare * options.sigma_px) break;
  }
  return pose;
}

}  // namespace plumb
