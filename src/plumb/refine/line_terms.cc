#include "plumb/refine/line_terms.h"

#include <algorithm>
#include <cmath>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

// Squared sine below which a line has no image that single precision can hold.
constexpr float kMinSquareSine = 1e-10f;

struct Pixel {
  float scale_x, scale_y, cx, cy;  // x = (u - cx) scale_x
};

/// Rows of both ends: those of the starts, then those of the ends.
PLUMB_SIMD_CLONES void LineKernel(size_t count, const Pixel px, const float* __restrict ax_,
                                  const float* __restrict ay_, const float* __restrict az_,
                                  const float* __restrict bx_, const float* __restrict by_,
                                  const float* __restrict bz_, const int32_t* __restrict line,
                                  const float* __restrict u_, const float* __restrict v_,
                                  float* __restrict residual, float* __restrict j0,
                                  float* __restrict j1, float* __restrict j2, float* __restrict j3,
                                  float* __restrict j4, float* __restrict j5) {
  for (size_t k = 0; k < count; ++k) {
    const int32_t i = line[k];
    const float ax = ax_[i], ay = ay_[i], az = az_[i];
    const float dx = bx_[i] - ax, dy = by_[i] - ay, dz = bz_[i] - az;
    const float nx = ay * dz - az * dy, ny = az * dx - ax * dz, nz = ax * dy - ay * dx;
    const float mx = nx * px.scale_x * px.scale_x, my = ny * px.scale_y * px.scale_y;
    const float square = nx * nx + ny * ny;
    const float bound =
        kMinSquareSine * (ax * ax + ay * ay + az * az) * (dx * dx + dy * dy + dz * dz);
    const bool exists = square > bound;
    const float inverse = exists ? 1.0f / std::sqrt(nx * mx + ny * my) : 0.0f;
    const float x = (u_[k] - px.cx) * px.scale_x, y = (v_[k] - px.cy) * px.scale_y;
    const float r = (nx * x + ny * y + nz) * inverse;
    const float s = r * inverse;
    const float qx = (x - s * mx) * inverse, qy = (y - s * my) * inverse, qz = inverse;
    residual[k] = r;
    j0[k] = ny * qz - nz * qy;
    j1[k] = nz * qx - nx * qz;
    j2[k] = nx * qy - ny * qx;
    j3[k] = dy * qz - dz * qy;
    j4[k] = dz * qx - dx * qz;
    j5[k] = dx * qy - dy * qx;
  }
}

/// Weights of the two ends' rows; `share` 0: each end by its own square, 1: both by their sum.
PLUMB_SIMD_CLONES void WeightKernel(size_t count, float inverse_robust_square, float share,
                                    const float* __restrict r0, const float* __restrict r1,
                                    const float* __restrict weight,
                                    const float* __restrict variance, float* __restrict w0,
                                    float* __restrict w1, float* __restrict squares,
                                    float* __restrict variances) {
  for (size_t k = 0; k < count; ++k) {
    const float a = r0[k] * r0[k], b = r1[k] * r1[k];
    const float inverse = 1.0f / variance[k];
    const float scale = inverse_robust_square * inverse;
    const float qa = 1.0f / (1.0f + (a + share * b) * scale);
    const float qb = 1.0f / (1.0f + (b + share * a) * scale);
    const float wa = weight[k] * inverse * qa * qa, wb = weight[k] * inverse * qb * qb;
    w0[k] = wa;
    w1[k] = wb;
    squares[k] = wa * a + wb * b;
    variances[k] = (wa + wb) * variance[k];
  }
}

PLUMB_SIMD_CLONES float Sum(size_t count, const float* __restrict a) {
  float sum = 0.0f;
  for (size_t k = 0; k < count; ++k) sum += a[k];
  return sum;
}

}  // namespace

void LineObservationTable::Resize(size_t count) {
  line.resize(count);
  for (std::vector<float>* column : {&x0, &y0, &x1, &y1, &weight, &variance_px2}) {
    column->resize(count);
  }
}

LineEquations LineAccumulator::Accumulate(const Camera& camera, const LineEnds& ends,
                                          const LineObservationTable& observations, double robust,
                                          LineLoss loss) {
  const size_t count = observations.size();
  rows_.Resize(2 * count);
  square_.resize(count);
  variance_.resize(count);
  const Pixel px{static_cast<float>(1.0 / camera.fx), static_cast<float>(1.0 / camera.fy),
                 static_cast<float>(camera.cx), static_cast<float>(camera.cy)};
  const auto fill = [&](const std::vector<float>& u, const std::vector<float>& v, size_t begin) {
    LineKernel(count, px, ends.start_x, ends.start_y, ends.start_z, ends.end_x, ends.end_y,
               ends.end_z, observations.line.data(), u.data(), v.data(),
               rows_.residual.data() + begin, rows_.jacobian[0].data() + begin,
               rows_.jacobian[1].data() + begin, rows_.jacobian[2].data() + begin,
               rows_.jacobian[3].data() + begin, rows_.jacobian[4].data() + begin,
               rows_.jacobian[5].data() + begin);
  };
  fill(observations.x0, observations.y0, 0);
  fill(observations.x1, observations.y1, count);
  // One loss over both ends has twice the square of one residual's scale.
  const bool both = loss == LineLoss::kBothEnds;
  WeightKernel(count, static_cast<float>((both ? 0.5 : 1.0) / (robust * robust)),
               both ? 1.0f : 0.0f, rows_.residual.data(), rows_.residual.data() + count,
               observations.weight.data(), observations.variance_px2.data(), rows_.weight.data(),
               rows_.weight.data() + count, square_.data(), variance_.data());
  LineEquations out;
  out.equations = SumRows(rows_);
  const double variances = static_cast<double>(Sum(count, variance_.data()));
  if (variances > 0.0) {
    out.residual_scale =
        static_cast<double>(Sum(count, square_.data())) / std::max(variances, 1e-9);
  }
  out.num_residuals = static_cast<int>(2 * count);
  return out;
}

}  // namespace plumb
