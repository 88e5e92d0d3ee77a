#include "plumb/search/field_lookup.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kMinDepth = 0.05f;  // keeps the division finite
constexpr float kTiny = 1e-20f;     // likewise
constexpr float kNearDepth = 0.1f;  // nearer samples are not in the image

struct View {
  float r[9], t[3];
  float fx, fy;
  float cell_fx, cell_fy, cell_cx, cell_cy;  // projection straight to cells, + 0.5 for rounding
  float last_column, last_row;               // exclusive bounds of the usable cells
  int32_t width;
};

// Eight numbers as one register, or two where there is none so wide.
using Lanes = float __attribute__((vector_size(LineSamples::kLanes * sizeof(float))));
using Integers = int32_t __attribute__((vector_size(LineSamples::kLanes * sizeof(int32_t))));

struct Columns {
  const float *x, *y, *z, *step_x, *step_y, *step_z, *weight;
};

PLUMB_SIMD_CLONES void LookUpKernel(const View v, size_t num_groups, const uint32_t* group_samples,
                                    const Columns in, int32_t* __restrict index,
                                    float* __restrict weight, float* __restrict out_x,
                                    float* __restrict out_y, float* __restrict inverse_depth) {
  const float r0 = v.r[0], r1 = v.r[1], r2 = v.r[2], r3 = v.r[3], r4 = v.r[4], r5 = v.r[5];
  const float r6 = v.r[6], r7 = v.r[7], r8 = v.r[8];
  const Lanes zero = {};
  for (size_t group = 0; group < num_groups; ++group) {
    const size_t line = group * LineSamples::kLanes;
    Lanes px, py, pz, dx, dy, dz, line_weight;
    std::memcpy(&px, in.x + line, sizeof(px));
    std::memcpy(&py, in.y + line, sizeof(py));
    std::memcpy(&pz, in.z + line, sizeof(pz));
    std::memcpy(&dx, in.step_x + line, sizeof(dx));
    std::memcpy(&dy, in.step_y + line, sizeof(dy));
    std::memcpy(&dz, in.step_z + line, sizeof(dz));
    std::memcpy(&line_weight, in.weight + line, sizeof(line_weight));
    Lanes ax = r0 * px + r1 * py + r2 * pz + v.t[0];
    Lanes ay = r3 * px + r4 * py + r5 * pz + v.t[1];
    Lanes az = r6 * px + r7 * py + r8 * pz + v.t[2];
    const Lanes sx = r0 * dx + r1 * dy + r2 * dz;
    const Lanes sy = r3 * dx + r4 * dy + r5 * dz;
    const Lanes sz = r6 * dx + r7 * dy + r8 * dz;
    // The image of a straight line is straight: one direction for all of its samples. Undirected
    // angle of (u, w) in [0, pi], with a quadratic arctangent.
    Lanes u = v.fx * (sx * az - ax * sz);
    Lanes w = v.fy * (sy * az - ay * sz);
    u = w < zero ? -u : u;
    w = w < zero ? -w : w;
    const Lanes magnitude = u < zero ? -u : u;
    const Lanes lower = magnitude < w ? magnitude : w, upper = magnitude < w ? w : magnitude;
    const Lanes ratio = lower / (upper > kTiny ? upper : zero + kTiny);
    Lanes angle = ratio * (0.25f * kPi + 0.273f - 0.273f * ratio);
    angle = magnitude < w ? 0.5f * kPi - angle : angle;
    angle = u < zero ? kPi - angle : angle;
    const Integers channel =
        __builtin_convertvector(angle * (DirectionField::kChannels / kPi), Integers) &
        (DirectionField::kChannels - 1);
    for (uint32_t k = group_samples[group]; k > 0; --k) {
      const Lanes inverse = 1.0f / (az > kMinDepth ? az : zero + kMinDepth);
      const Lanes x = ax * inverse, y = ay * inverse;
      const Lanes column = v.cell_fx * x + v.cell_cx, row = v.cell_fy * y + v.cell_cy;
      const Integers inside = (az > kNearDepth) & (column >= 1.0f) & (column < v.last_column) &
                              (row >= 1.0f) & (row < v.last_row);
      const Integers c = __builtin_convertvector(inside ? column : zero + 1.0f, Integers);
      const Integers r = __builtin_convertvector(inside ? row : zero + 1.0f, Integers);
      const Integers at = (r * v.width + c) * DirectionField::kChannels + channel;
      const Lanes counts = inside ? line_weight : zero;
      std::memcpy(index, &at, sizeof(at));
      std::memcpy(weight, &counts, sizeof(counts));
      std::memcpy(out_x, &x, sizeof(x));
      std::memcpy(out_y, &y, sizeof(y));
      std::memcpy(inverse_depth, &inverse, sizeof(inverse));
      index += LineSamples::kLanes;
      weight += LineSamples::kLanes;
      out_x += LineSamples::kLanes;
      out_y += LineSamples::kLanes;
      inverse_depth += LineSamples::kLanes;
      ax += sx;
      ay += sy;
      az += sz;
    }
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
  out->Resize(samples.num_slots);
  const LineSamples::Columns& in = samples.columns;
  LookUpKernel(view, samples.group_samples.size(), samples.group_samples.data(),
               {in.x.data(), in.y.data(), in.z.data(), in.step_x.data(), in.step_y.data(),
                in.step_z.data(), in.weight.data()},
               out->index.data(), out->weight.data(), out->x.data(), out->y.data(),
               out->inverse_depth.data());
}

}  // namespace plumb
