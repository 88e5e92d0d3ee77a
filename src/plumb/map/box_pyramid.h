// Implicit hierarchy over axis-aligned boxes, eight of them tested at a time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/map/box_tree.h"

namespace plumb {

/// What a box must touch: the inside of all planes (normal . x + offset >= 0) and a sphere around
/// `center` of `reach_factor` times the box's own reach.
struct BoxQuery {
  static constexpr size_t kPlanes = 5;
  std::array<Eigen::Vector3d, kPlanes> normals;  // unit
  std::array<double, kPlanes> offsets = {};
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double reach_factor = 1.0;
};

/// Immutable after construction. Items are ordered by halving them along the widest axis of their
/// centres (ties by index) such that every aligned run of 8, 64, 512, ... items belongs together:
/// the leaves are such runs of 8 items, and no pointers are needed. Boxes are kept in single
/// precision around the common centre, rounded outwards, so that nothing is lost.
class BoxPyramid {
 public:
  static constexpr size_t kFan = 8;

  /// @param reach  Of every item, for BoxQuery; a node has the longest of its items.
  BoxPyramid(std::span<const Box> boxes, std::span<const float> reach);

  /// Indices of the items; leaf i holds order()[8 i .. 8 i + 8), the last one may hold fewer.
  std::span<const uint32_t> order() const { return order_; }

  /// Leaves that may touch the query, ascending. No allocation once `out` has the capacity.
  void Find(const BoxQuery& query, std::vector<uint32_t>* out) const;
  /// The same without vectors, for the tests.
  void FindPlainly(const BoxQuery& query, std::vector<uint32_t>* out) const;

 private:
  /// Parallel arrays, filled up to a multiple of kFan with boxes that touch nothing.
  struct Level {
    std::vector<float> lower_x, lower_y, lower_z, upper_x, upper_y, upper_z, reach;
    size_t size = 0;
  };
  /// The query around center_, with room for all rounding.
  struct Shifted {
    float normal[BoxQuery::kPlanes][3];
    float offset[BoxQuery::kPlanes];
    float center[3];
    float reach_factor, slack;
  };

  void Sort(std::span<const Box> boxes, size_t begin, size_t end);
  Shifted Shift(const BoxQuery& query) const;
  static size_t Descend(const Level& level, const Shifted& query, const uint32_t* groups,
                        size_t count, uint32_t* out);

  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  float slack_ = 0.0f;  // [m] by which single precision may be wrong
  std::vector<uint32_t> order_;
  std::vector<Level> levels_;  // leaves first; the last has at most kFan boxes
};

}  // namespace plumb
