#include "plumb/map/box_pyramid.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr size_t kFan = BoxPyramid::kFan;
constexpr float kHuge = 1e30f;

using Lanes = float __attribute__((vector_size(kFan * sizeof(float))));
using Integers = int32_t __attribute__((vector_size(kFan * sizeof(int32_t))));

struct Columns {
  const float *lower_x, *lower_y, *lower_z, *upper_x, *upper_y, *upper_z, *reach;
};

/// For every group of eight boxes its boxes that touch the query, in order. `out` has room for all.
PLUMB_SIMD_CLONES size_t DescendKernel(const Columns boxes, const float (*normal)[3],
                                       const float* offset, const float* center, float reach_factor,
                                       float slack, const uint32_t* groups, size_t count,
                                       uint32_t* out) {
  const Lanes zero = {};
  // The corner of a box that lies farthest along a normal: its lower or upper side on each axis.
  const float* side[BoxQuery::kPlanes][3];
  for (size_t p = 0; p < BoxQuery::kPlanes; ++p) {
    side[p][0] = normal[p][0] < 0.0f ? boxes.lower_x : boxes.upper_x;
    side[p][1] = normal[p][1] < 0.0f ? boxes.lower_y : boxes.upper_y;
    side[p][2] = normal[p][2] < 0.0f ? boxes.lower_z : boxes.upper_z;
  }
  size_t found = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t first = groups[i] * kFan;
    Integers touches = {-1, -1, -1, -1, -1, -1, -1, -1};
    for (size_t p = 0; p < BoxQuery::kPlanes; ++p) {
      Lanes x, y, z;
      std::memcpy(&x, side[p][0] + first, sizeof(x));
      std::memcpy(&y, side[p][1] + first, sizeof(y));
      std::memcpy(&z, side[p][2] + first, sizeof(z));
      const Lanes support =
          normal[p][0] * x + normal[p][1] * y + normal[p][2] * z + (offset[p] + slack);
      touches &= support >= zero;
    }
    Lanes low, high, off, square = zero, reach;
    std::memcpy(&low, boxes.lower_x + first, sizeof(low));
    std::memcpy(&high, boxes.upper_x + first, sizeof(high));
    off = low - center[0] > center[0] - high ? low - center[0] : center[0] - high;
    off = off > zero ? off : zero;
    square += off * off;
    std::memcpy(&low, boxes.lower_y + first, sizeof(low));
    std::memcpy(&high, boxes.upper_y + first, sizeof(high));
    off = low - center[1] > center[1] - high ? low - center[1] : center[1] - high;
    off = off > zero ? off : zero;
    square += off * off;
    std::memcpy(&low, boxes.lower_z + first, sizeof(low));
    std::memcpy(&high, boxes.upper_z + first, sizeof(high));
    off = low - center[2] > center[2] - high ? low - center[2] : center[2] - high;
    off = off > zero ? off : zero;
    square += off * off;
    std::memcpy(&reach, boxes.reach + first, sizeof(reach));
    reach = reach * reach_factor + slack;
    touches &= square <= reach * reach;
    int32_t keep[kFan];
    std::memcpy(keep, &touches, sizeof(keep));
    for (size_t lane = 0; lane < kFan; ++lane) {
      out[found] = static_cast<uint32_t>(first + lane);
      found += static_cast<size_t>(keep[lane] & 1);
    }
  }
  return found;
}

}  // namespace

BoxPyramid::BoxPyramid(std::span<const Box> boxes, std::span<const float> reach)
    : order_(boxes.size()) {
  std::iota(order_.begin(), order_.end(), 0u);
  if (boxes.empty()) return;
  Box all = boxes[0];
  for (const Box& box : boxes) all.Extend(box);
  center_ = 0.5 * (all.lower + all.upper);
  const double extent = (all.upper - center_).cwiseMax(center_ - all.lower).maxCoeff();
  slack_ = static_cast<float>(1e-5 + 1e-6 * extent);
  Sort(boxes, 0, boxes.size());

  const auto resize = [](Level* level, size_t size) {
    level->size = size;
    const size_t padded = (size + kFan - 1) / kFan * kFan;
    for (std::vector<float>* column : {&level->lower_x, &level->lower_y, &level->lower_z}) {
      column->assign(padded, kHuge);
    }
    for (std::vector<float>* column : {&level->upper_x, &level->upper_y, &level->upper_z}) {
      column->assign(padded, -kHuge);
    }
    level->reach.assign(padded, 0.0f);
  };
  const auto extend = [](Level* level, size_t i, const float lower[3], const float upper[3],
                         float item_reach) {
    level->lower_x[i] = std::min(level->lower_x[i], lower[0]);
    level->lower_y[i] = std::min(level->lower_y[i], lower[1]);
    level->lower_z[i] = std::min(level->lower_z[i], lower[2]);
    level->upper_x[i] = std::max(level->upper_x[i], upper[0]);
    level->upper_y[i] = std::max(level->upper_y[i], upper[1]);
    level->upper_z[i] = std::max(level->upper_z[i], upper[2]);
    level->reach[i] = std::max(level->reach[i], item_reach);
  };
  resize(&levels_.emplace_back(), (boxes.size() + kFan - 1) / kFan);
  for (size_t i = 0; i < order_.size(); ++i) {
    const Box& box = boxes[order_[i]];
    const Eigen::Vector3f lower = (box.lower - center_).cast<float>();
    const Eigen::Vector3f upper = (box.upper - center_).cast<float>();
    extend(&levels_[0], i / kFan, lower.data(), upper.data(), reach[order_[i]]);
  }
  while (levels_.back().size > kFan) {
    Level above;
    resize(&above, (levels_.back().size + kFan - 1) / kFan);
    const Level& below = levels_.back();
    for (size_t i = 0; i < below.size; ++i) {
      const float lower[3] = {below.lower_x[i], below.lower_y[i], below.lower_z[i]};
      const float upper[3] = {below.upper_x[i], below.upper_y[i], below.upper_z[i]};
      extend(&above, i / kFan, lower, upper, below.reach[i]);
    }
    levels_.push_back(std::move(above));
  }
}

void BoxPyramid::Sort(std::span<const Box> boxes, size_t begin, size_t end) {
  const size_t leaves = (end - begin + kFan - 1) / kFan;
  if (leaves < 2) return;
  Box centers;
  for (size_t i = begin; i < end; ++i) {
    const Box& item = boxes[order_[i]];
    const Eigen::Vector3d twice = item.lower + item.upper;
    if (i == begin) centers = {twice, twice};
    centers.Extend({twice, twice});
  }
  Eigen::Index axis = 0;
  (centers.upper - centers.lower).maxCoeff(&axis);
  // The first part is the largest power of two of leaves: whatever follows it is aligned too.
  const size_t middle = begin + kFan * std::bit_floor(leaves - 1);
  std::nth_element(order_.begin() + static_cast<ptrdiff_t>(begin),
                   order_.begin() + static_cast<ptrdiff_t>(middle),
                   order_.begin() + static_cast<ptrdiff_t>(end), [&](uint32_t a, uint32_t b) {
                     const double center_a = boxes[a].lower[axis] + boxes[a].upper[axis];
                     const double center_b = boxes[b].lower[axis] + boxes[b].upper[axis];
                     return center_a != center_b ? center_a < center_b : a < b;
                   });
  Sort(boxes, begin, middle);
  Sort(boxes, middle, end);
}

BoxPyramid::Shifted BoxPyramid::Shift(const BoxQuery& query) const {
  Shifted out;
  for (size_t p = 0; p < BoxQuery::kPlanes; ++p) {
    for (int axis = 0; axis < 3; ++axis) {
      out.normal[p][axis] = static_cast<float>(query.normals[p][axis]);
    }
    out.offset[p] = static_cast<float>(query.offsets[p] + query.normals[p].dot(center_));
  }
  const Eigen::Vector3d center = query.center - center_;
  for (int axis = 0; axis < 3; ++axis) out.center[axis] = static_cast<float>(center[axis]);
  out.reach_factor = static_cast<float>(query.reach_factor) * 1.00001f;
  // Cameras may be far outside of the map.
  out.slack = slack_ + 1e-6f * static_cast<float>(center.norm());
  return out;
}

size_t BoxPyramid::Descend(const Level& level, const Shifted& query, const uint32_t* groups,
                           size_t count, uint32_t* out) {
  return DescendKernel(
      {level.lower_x.data(), level.lower_y.data(), level.lower_z.data(), level.upper_x.data(),
       level.upper_y.data(), level.upper_z.data(), level.reach.data()},
      query.normal, query.offset, query.center, query.reach_factor, query.slack, groups, count,
      out);
}

void BoxPyramid::Find(const BoxQuery& query, std::vector<uint32_t>* out) const {
  out->clear();
  if (levels_.empty()) return;
  const Shifted shifted = Shift(query);
  // The work space lives as long as the thread. A box that touches is the group of those below it.
  thread_local std::vector<uint32_t> groups, next;
  groups.assign(1, 0u);
  for (size_t i = levels_.size() - 1; i > 0; --i) {
    next.resize(groups.size() * kFan);
    next.resize(Descend(levels_[i], shifted, groups.data(), groups.size(), next.data()));
    std::swap(groups, next);
  }
  out->resize(groups.size() * kFan);
  out->resize(Descend(levels_[0], shifted, groups.data(), groups.size(), out->data()));
}

void BoxPyramid::FindPlainly(const BoxQuery& query, std::vector<uint32_t>* out) const {
  out->clear();
  if (levels_.empty()) return;
  const Shifted shifted = Shift(query);
  const Level& leaves = levels_[0];
  for (size_t i = 0; i < leaves.size; ++i) {
    const Eigen::Vector3f lower(leaves.lower_x[i], leaves.lower_y[i], leaves.lower_z[i]);
    const Eigen::Vector3f upper(leaves.upper_x[i], leaves.upper_y[i], leaves.upper_z[i]);
    bool touches = true;
    for (size_t p = 0; p < BoxQuery::kPlanes; ++p) {
      const Eigen::Vector3f normal(shifted.normal[p]);
      const float support = normal.cwiseProduct(lower).cwiseMax(normal.cwiseProduct(upper)).sum();
      touches &= support + shifted.offset[p] + shifted.slack >= 0.0f;
    }
    const Eigen::Vector3f center(shifted.center);
    const float distance = (lower - center).cwiseMax(center - upper).cwiseMax(0.0f).norm();
    touches &= distance <= leaves.reach[i] * shifted.reach_factor + shifted.slack;
    if (touches) out->push_back(static_cast<uint32_t>(i));
  }
}

}  // namespace plumb
