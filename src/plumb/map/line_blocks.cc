#include "plumb/map/line_blocks.h"

#include <algorithm>
#include <cstring>

#include "plumb/base/simd_clones.h"
#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr size_t kLanes = LineBlocks::kLanes;
// Lines with an end nearer than this are left to double precision: rounding counts most for them.
constexpr float kTrustedDepth = 0.5f;
// How far off single precision may put a point: so many pixels, and such a share of its distance
// from the image.
constexpr float kErrorPx = 4e-3f, kErrorShare = 2e-5f;
constexpr float kTiny = 1e-6f;  // keeps divisions finite

using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
using Integers = int32_t __attribute__((vector_size(kLanes * sizeof(int32_t))));

struct View {
  double rotation[9], translation[3];
  float fx, fy, cx, cy;
  float low, right, bottom;  // borders of the enlarged image
  float min_length;
  int32_t min_observing;
};

struct Columns {
  const double* origins;
  const float *start_x, *start_y, *start_z, *end_x, *end_y, *end_z;
  const int32_t* num_observing;
};

/// `out` has room for all rows of the blocks.
PLUMB_SIMD_CLONES size_t ProjectKernel(const View& view, const Columns& in, const uint32_t* blocks,
                                       size_t count, BlockLine* out) {
  float r[9];
  for (int i = 0; i < 9; ++i) r[i] = static_cast<float>(view.rotation[i]);
  const Lanes zero = {};
  size_t found = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t row = blocks[i] * kLanes;
    const double* const o = in.origins + 3 * blocks[i];
    float t[3];
    for (int k = 0; k < 3; ++k) {
      t[k] = static_cast<float>(view.rotation[3 * k] * o[0] + view.rotation[3 * k + 1] * o[1] +
                                view.rotation[3 * k + 2] * o[2] + view.translation[k]);
    }
    Lanes px, py, pz;
    std::memcpy(&px, in.start_x + row, sizeof(px));
    std::memcpy(&py, in.start_y + row, sizeof(py));
    std::memcpy(&pz, in.start_z + row, sizeof(pz));
    const Lanes ax = r[0] * px + r[1] * py + r[2] * pz + t[0];
    const Lanes ay = r[3] * px + r[4] * py + r[5] * pz + t[1];
    const Lanes az = r[6] * px + r[7] * py + r[8] * pz + t[2];
    std::memcpy(&px, in.end_x + row, sizeof(px));
    std::memcpy(&py, in.end_y + row, sizeof(py));
    std::memcpy(&pz, in.end_z + row, sizeof(pz));
    const Lanes bx = r[0] * px + r[1] * py + r[2] * pz + t[0];
    const Lanes by = r[3] * px + r[4] * py + r[5] * pz + t[1];
    const Lanes bz = r[6] * px + r[7] * py + r[8] * pz + t[2];
    Integers observing;
    std::memcpy(&observing, in.num_observing + row, sizeof(observing));
    const Integers exists = observing >= view.min_observing;
    const Integers is_far = (az > kTrustedDepth) & (bz > kTrustedDepth);
    const Integers is_behind = (az < 0.0f) & (bz < 0.0f);

    const Lanes inverse_a = 1.0f / (is_far ? az : zero + 1.0f);
    const Lanes inverse_b = 1.0f / (is_far ? bz : zero + 1.0f);
    const Lanes sx = view.fx * ax * inverse_a + view.cx, sy = view.fy * ay * inverse_a + view.cy;
    const Lanes dx = view.fx * bx * inverse_b + view.cx - sx;
    const Lanes dy = view.fy * by * inverse_b + view.cy - sy;
    // Liang-Barsky against the four borders.
    const Lanes wide_x = dx < zero ? -dx : dx, wide_y = dy < zero ? -dy : dy;
    const Lanes inverse_dx = 1.0f / (wide_x < kTiny ? zero + kTiny : dx);
    const Lanes inverse_dy = 1.0f / (wide_y < kTiny ? zero + kTiny : dy);
    const Lanes x0 = (view.low - sx) * inverse_dx, x1 = (view.right - sx) * inverse_dx;
    const Lanes y0 = (view.low - sy) * inverse_dy, y1 = (view.bottom - sy) * inverse_dy;
    const Lanes first_x = x0 < x1 ? x0 : x1, last_x = x0 < x1 ? x1 : x0;
    const Lanes first_y = y0 < y1 ? y0 : y1, last_y = y0 < y1 ? y1 : y0;
    Lanes u0 = first_x > first_y ? first_x : first_y;
    Lanes u1 = last_x < last_y ? last_x : last_y;
    u0 = u0 > zero ? u0 : zero;
    u1 = u1 < 1.0f ? u1 : zero + 1.0f;
    const Lanes square = dx * dx + dy * dy;
    Lanes root;
    for (size_t lane = 0; lane < kLanes; ++lane) root[lane] = __builtin_sqrtf(square[lane]);
    const Lanes length = (u1 - u0) * root;
    // A border that cuts the line at a small angle moves the cut by more than the line is off.
    const Lanes steep_x = inverse_dx < zero ? -inverse_dx : inverse_dx;
    const Lanes steep_y = inverse_dy < zero ? -inverse_dy : inverse_dy;
    const Lanes steep = steep_x > steep_y ? steep_x : steep_y;
    const Lanes off_x = sx < zero ? -sx : sx, off_y = sy < zero ? -sy : sy;
    const Lanes error = kErrorPx + kErrorShare * (off_x + off_y + root);
    const Integers is_cut = (u0 > zero) | (u1 < 1.0f);
    const Lanes tolerance = error * (is_cut ? 2.0f + root * steep : zero + 2.0f);
    const Lanes above = length - view.min_length;
    const Integers is_sure = is_far & (above > tolerance);
    const Integers is_out = is_behind | (is_far & (above < -tolerance));
    const Integers is_in = exists & ~is_out;
    const Lanes told = is_sure ? length : zero - 1.0f;
    int32_t keep[kLanes];
    float lengths[kLanes];
    std::memcpy(keep, &is_in, sizeof(keep));
    std::memcpy(lengths, &told, sizeof(lengths));
    for (size_t lane = 0; lane < kLanes; ++lane) {
      out[found].row = static_cast<uint32_t>(row + lane);
      out[found].length_px = lengths[lane];
      found += static_cast<size_t>(keep[lane] & 1);
    }
  }
  return found;
}

}  // namespace

LineBlocks::LineBlocks(const LineMap& map, std::span<const uint32_t> order) {
  const size_t num_blocks = (order.size() + kLanes - 1) / kLanes;
  origins_.reserve(num_blocks);
  for (std::vector<float>* column : {&start_x_, &start_y_, &start_z_, &end_x_, &end_y_, &end_z_}) {
    column->assign(num_blocks * kLanes, 0.0f);
  }
  num_observing_.assign(num_blocks * kLanes, -1);
  for (size_t row = 0; row < order.size(); ++row) {
    const MapLine& line = map.lines[order[row]];
    if (row % kLanes == 0) origins_.push_back(line.segment_in_world.Midpoint());
    const Eigen::Vector3f start = (line.segment_in_world.start - origins_.back()).cast<float>();
    const Eigen::Vector3f end = (line.segment_in_world.end - origins_.back()).cast<float>();
    start_x_[row] = start.x();
    start_y_[row] = start.y();
    start_z_[row] = start.z();
    end_x_[row] = end.x();
    end_y_[row] = end.y();
    end_z_[row] = end.z();
    num_observing_[row] = static_cast<int32_t>(std::min<uint32_t>(line.num_observing, 0x7fffffff));
  }
}

void LineBlocks::Project(const Camera& camera, const Rigid3& cam_from_world, double margin_px,
                         double min_length_px, uint32_t min_observing,
                         std::span<const uint32_t> blocks, std::vector<BlockLine>* out) const {
  View view;
  const Eigen::Matrix3d rotation = cam_from_world.RotationMatrix();
  for (int i = 0; i < 9; ++i) view.rotation[i] = rotation(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) view.translation[i] = cam_from_world.translation[i];
  view.fx = static_cast<float>(camera.fx);
  view.fy = static_cast<float>(camera.fy);
  view.cx = static_cast<float>(camera.cx);
  view.cy = static_cast<float>(camera.cy);
  view.low = static_cast<float>(-margin_px);
  view.right = static_cast<float>(camera.width_px - 1 + margin_px);
  view.bottom = static_cast<float>(camera.height_px - 1 + margin_px);
  view.min_length = static_cast<float>(min_length_px);
  view.min_observing = static_cast<int32_t>(std::min<uint32_t>(min_observing, 0x7fffffff));
  out->resize(blocks.size() * kLanes + 1);  // the kernel writes before it knows
  out->resize(ProjectKernel(
      view,
      {origins_.empty() ? nullptr : origins_[0].data(), start_x_.data(), start_y_.data(),
       start_z_.data(), end_x_.data(), end_y_.data(), end_z_.data(), num_observing_.data()},
      blocks.data(), blocks.size(), out->data()));
}

}  // namespace plumb
