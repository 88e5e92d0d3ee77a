#include "plumb/search/field_lookup.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kMinDepth = 0.05f;  // keeps the division finite
constexpr float kNearDepth = 0.1f;  // nearer samples are not in the image

struct View {
  float r[9], t[3];
  float fx, fy;
  float cell_fx, cell_fy, cell_cx, cell_cy;  // projection straight to cells, + 0.5 for rounding
  float last_column, last_row;               // exclusive bounds of the usable cells
  int32_t width;
};

PLUMB_SIMD_CLONES void LookUpKernel(const View v, size_t count, const float* __restrict in_x,
                                    const float* __restrict in_y, const float* __restrict in_z,
                                    const float* __restrict in_dx, const float* __restrict in_dy,
                                    const float* __restrict in_dz,
                                    const float* __restrict in_weight, int32_t* __restrict index,
                                    float* __restrict weight, float* __restrict out_x,
                                    float* __restrict out_y, float* __restrict inverse_depth) {
  const float r0 = v.r[0], r1 = v.r[1], r2 = v.r[2], r3 = v.r[3], r4 = v.r[4], r5 = v.r[5];
  const float r6 = v.r[6], r7 = v.r[7], r8 = v.r[8], t0 = v.t[0], t1 = v.t[1], t2 = v.t[2];
  const float fx = v.fx, fy = v.fy, cell_fx = v.cell_fx, cell_fy = v.cell_fy;
  const float cell_cx = v.cell_cx, cell_cy = v.cell_cy;
  const float last_column = v.last_column, last_row = v.last_row;
  const int32_t width = v.width;
  for (size_t k = 0; k < count; ++k) {
    const float px = in_x[k], py = in_y[k], pz = in_z[k];
    const float depth = r6 * px + r7 * py + r8 * pz + t2;
    const float inverse = 1.0f / std::max(depth, kMinDepth);
    const float x = (r0 * px + r1 * py + r2 * pz + t0) * inverse;
    const float y = (r3 * px + r4 * py + r5 * pz + t1) * inverse;
    const float dx = in_dx[k], dy = in_dy[k], dz = in_dz[k];
    const float turned_z = r6 * dx + r7 * dy + r8 * dz;
    float u = fx * (r0 * dx + r1 * dy + r2 * dz - x * turned_z);
    float w = fy * (r3 * dx + r4 * dy + r5 * dz - y * turned_z);
    // Undirected angle of (u, w) in [0, pi], with a quadratic arctangent.
    u = w < 0.0f ? -u : u;
    w = std::abs(w);
    const float magnitude = std::abs(u);
    const float ratio = std::min(magnitude, w) / std::max(std::max(magnitude, w), 1e-20f);
    float angle = ratio * (0.25f * kPi + 0.273f - 0.273f * ratio);
    angle = magnitude < w ? 0.5f * kPi - angle : angle;
    angle = u < 0.0f ? kPi - angle : angle;
    const int32_t channel = static_cast<int32_t>(angle * (DirectionField::kChannels / kPi)) &
                            (DirectionField::kChannels - 1);

    const float column = cell_fx * x + cell_cx, row = cell_fy * y + cell_cy;
    const bool inside = (depth > kNearDepth) & (column >= 1.0f) & (column < last_column) &
                        (row >= 1.0f) & (row < last_row);
    const int32_t c = static_cast<int32_t>(inside ? column : 1.0f);
    const int32_t r = static_cast<int32_t>(inside ? row : 1.0f);
    index[k] = (r * width + c) * DirectionField::kChannels + channel;
    weight[k] = inside ? in_weight[k] : 0.0f;
    out_x[k] = x;
    out_y[k] = y;
    inverse_depth[k] = inverse;
  }
}

}  // namespace

Rigid3 RelativePose::After(const Rigid3& reference_from_world) const {
  const Rigid3 cam_from_reference{Eigen::Quaterniond(rotation.cast<double>().eval()).normalized(),
                                  translation.cast<double>()};
  return cam_from_reference * reference_from_world;
}

void FieldLookups::Resize(size_t count) {
  index.resize(count);
  for (std::vector<float>* column : {&weight, &x, &y, &inverse_depth}) column->resize(count);
}

void LookUp(const Camera& camera, const DirectionField& field, const RelativePose& pose,
            const LineSamples& samples, FieldLookups* out) {
  View view;
  for (int i = 0; i < 9; ++i) view.r[i] = pose.rotation(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) view.t[i] = pose.translation[i];
  view.fx = static_cast<float>(camera.fx);
  view.fy = static_cast<float>(camera.fy);
  const double scale = 1.0 / field.cell_px();
  view.cell_fx = static_cast<float>(camera.fx * scale);
  view.cell_fy = static_cast<float>(camera.fy * scale);
  view.cell_cx = static_cast<float>(camera.cx * scale + field.border_cells() + 0.5);
  view.cell_cy = static_cast<float>(camera.cy * scale + field.border_cells() + 0.5);
  view.last_column = static_cast<float>(field.width() - 1);
  view.last_row = static_cast<float>(field.height() - 1);
  view.width = field.width();
  LookUpKernel(view, samples.padded_size(), samples.x.data(), samples.y.data(), samples.z.data(),
               samples.direction_x.data(), samples.direction_y.data(), samples.direction_z.data(),
               samples.weight.data(), out->index.data(), out->weight.data(), out->x.data(),
               out->y.data(), out->inverse_depth.data());
}

}  // namespace plumb
