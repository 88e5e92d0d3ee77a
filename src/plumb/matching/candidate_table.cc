#include "plumb/matching/candidate_table.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plumb/base/simd_clones.h"
#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kTiny = 1e-6f;  // keeps divisions finite

struct View {
  float r[9], t[3];
  float fx, fy, cx, cy, last_x, last_y;
  float near, min_length;
};

PLUMB_SIMD_CLONES void ProjectKernel(const View v, size_t count, const float* __restrict in_ax,
                                     const float* __restrict in_ay, const float* __restrict in_az,
                                     const float* __restrict in_bx, const float* __restrict in_by,
                                     const float* __restrict in_bz, float* __restrict out_x,
                                     float* __restrict out_y, float* __restrict out_dx,
                                     float* __restrict out_dy, float* __restrict out_length,
                                     float* __restrict out_angle, float* __restrict out_ax,
                                     float* __restrict out_ay, float* __restrict out_az,
                                     float* __restrict out_bx, float* __restrict out_by,
                                     float* __restrict out_bz) {
  const float r0 = v.r[0], r1 = v.r[1], r2 = v.r[2], r3 = v.r[3], r4 = v.r[4], r5 = v.r[5];
  const float r6 = v.r[6], r7 = v.r[7], r8 = v.r[8], t0 = v.t[0], t1 = v.t[1], t2 = v.t[2];
  const float fx = v.fx, fy = v.fy, cx = v.cx, cy = v.cy, last_x = v.last_x, last_y = v.last_y;
  const float near = v.near, min_length = v.min_length;
  for (size_t k = 0; k < count; ++k) {
    const float pax = in_ax[k], pay = in_ay[k], paz = in_az[k];
    const float pbx = in_bx[k], pby = in_by[k], pbz = in_bz[k];
    const float ax = r0 * pax + r1 * pay + r2 * paz + t0;
    const float ay = r3 * pax + r4 * pay + r5 * paz + t1;
    const float az = r6 * pax + r7 * pay + r8 * paz + t2;
    const float bx = r0 * pbx + r1 * pby + r2 * pbz + t0;
    const float by = r3 * pbx + r4 * pby + r5 * pbz + t1;
    const float bz = r6 * pbx + r7 * pby + r8 * pbz + t2;
    out_ax[k] = ax;
    out_ay[k] = ay;
    out_az[k] = az;
    out_bx[k] = bx;
    out_by[k] = by;
    out_bz[k] = bz;
    // Parameters along a..b at which the line crosses the near plane.
    const float slope = bz - az;
    const float cross = (near - az) / (std::abs(slope) < kTiny ? kTiny : slope);
    const float ua = az < near ? cross : 0.0f, ub = bz < near ? cross : 1.0f;
    const float inverse_a = 1.0f / std::max(az + ua * slope, near);
    const float inverse_b = 1.0f / std::max(az + ub * slope, near);
    const float sx = fx * (ax + ua * (bx - ax)) * inverse_a + cx;
    const float sy = fy * (ay + ua * (by - ay)) * inverse_a + cy;
    const float dx = fx * (ax + ub * (bx - ax)) * inverse_b + cx - sx;
    const float dy = fy * (ay + ub * (by - ay)) * inverse_b + cy - sy;
    // Liang-Barsky against the four borders.
    const float inverse_dx = 1.0f / (std::abs(dx) < kTiny ? kTiny : dx);
    const float inverse_dy = 1.0f / (std::abs(dy) < kTiny ? kTiny : dy);
    const float x0 = -sx * inverse_dx, x1 = (last_x - sx) * inverse_dx;
    const float y0 = -sy * inverse_dy, y1 = (last_y - sy) * inverse_dy;
    const float u0 = std::max(std::max(std::min(x0, x1), std::min(y0, y1)), 0.0f);
    const float u1 = std::min(std::min(std::max(x0, x1), std::max(y0, y1)), 1.0f);
    const float share = u1 - u0;
    const float whole = std::sqrt(dx * dx + dy * dy);
    const float length = share * whole;
    const bool in_front = (az > near) | (bz > near);
    const bool visible = in_front & (share > 0.0f) & (length > min_length);
    const float inverse_whole = 1.0f / std::max(whole, kTiny);
    const float ex = dx * inverse_whole, ey = dy * inverse_whole;
    out_x[k] = visible ? sx + u0 * dx : 0.0f;
    out_y[k] = visible ? sy + u0 * dy : 0.0f;
    out_dx[k] = visible ? ex : 1.0f;
    out_dy[k] = visible ? ey : 0.0f;
    out_length[k] = visible ? length : 0.0f;
    // Undirected angle with a quadratic arctangent.
    const float u = ey < 0.0f ? -ex : ex, w = std::abs(ey), magnitude = std::abs(u);
    const float ratio = std::min(magnitude, w) / std::max(std::max(magnitude, w), kTiny);
    float angle = ratio * (0.25f * kPi + 0.273f - 0.273f * ratio);
    angle = magnitude < w ? 0.5f * kPi - angle : angle;
    angle = u < 0.0f ? kPi - angle : angle;
    out_angle[k] = visible ? angle : 0.0f;
  }
}

}  // namespace

void CandidateTable::Assign(std::span<const CandidateLine> lines, const Rigid3& reference) {
  reference_from_world = reference;
  count = lines.size();
  const size_t padded = (count + kLanes - 1) / kLanes * kLanes;
  for (std::vector<float>* column : {&start_x, &start_y, &start_z, &end_x, &end_y, &end_z}) {
    column->assign(padded, -1.0f);  // behind the camera of every pose that is near the reference
  }
  weight.assign(padded, 0.0f);
  const Eigen::Matrix3d rotation = reference.RotationMatrix();
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3f a =
        (rotation * lines[i].segment_in_world.start + reference.translation).cast<float>();
    const Eigen::Vector3f b =
        (rotation * lines[i].segment_in_world.end + reference.translation).cast<float>();
    start_x[i] = a.x();
    start_y[i] = a.y();
    start_z[i] = a.z();
    end_x[i] = b.x();
    end_y[i] = b.y();
    end_z[i] = b.z();
    weight[i] = static_cast<float>(lines[i].weight);
  }
}

void ProjectTable(const Camera& camera, const Rigid3& cam_from_world, const CandidateTable& table,
                  double min_length_px, ProjectedLines* out) {
  const Rigid3 relative = cam_from_world * table.reference_from_world.Inverse();
  const Eigen::Matrix3d rotation = relative.RotationMatrix();
  View view;
  for (int i = 0; i < 9; ++i) view.r[i] = static_cast<float>(rotation(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) view.t[i] = static_cast<float>(relative.translation[i]);
  view.fx = static_cast<float>(camera.fx);
  view.fy = static_cast<float>(camera.fy);
  view.cx = static_cast<float>(camera.cx);
  view.cy = static_cast<float>(camera.cy);
  view.last_x = static_cast<float>(camera.width_px - 1);
  view.last_y = static_cast<float>(camera.height_px - 1);
  view.near = static_cast<float>(kNearPlane);
  view.min_length = static_cast<float>(min_length_px);
  const size_t size = table.padded_size();
  out->Resize(size);
  for (size_t i = 0; i < size; ++i) {
    out->line[i] = static_cast<uint32_t>(i);
    out->weight[i] = table.weight[i];
  }
  ProjectKernel(view, size, table.start_x.data(), table.start_y.data(), table.start_z.data(),
                table.end_x.data(), table.end_y.data(), table.end_z.data(), out->x.data(),
                out->y.data(), out->direction_x.data(), out->direction_y.data(), out->length.data(),
                out->angle.data(), out->start_x.data(), out->start_y.data(), out->start_z.data(),
                out->end_x.data(), out->end_y.data(), out->end_z.data());
  // Padding is not visible from any pose.
  for (size_t i = table.count; i < size; ++i) out->length[i] = 0.0f;
}

}  // namespace plumb
