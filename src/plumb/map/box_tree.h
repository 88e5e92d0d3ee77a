// Flat bounding volume hierarchy over axis-aligned boxes.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace plumb {

struct Box {
  Eigen::Vector3d lower = Eigen::Vector3d::Zero();
  Eigen::Vector3d upper = Eigen::Vector3d::Zero();

  void Extend(const Box& other) {
    lower = lower.cwiseMin(other.lower);
    upper = upper.cwiseMax(other.upper);
  }
  /// 0 inside.
  double DistanceTo(const Eigen::Vector3d& point) const {
    return (lower - point).cwiseMax(point - upper).cwiseMax(0.0).norm();
  }
};

/// Immutable after construction. Halves the boxes at the median of their centres along the widest
/// axis (ties by index), so the depth is at most log2 of their number and equal input gives an
/// equal tree.
class BoxTree {
 public:
  struct Node {
    Box box;
    uint32_t begin = 0, end = 0;  // range of order()
    uint32_t second_child = 0;    // the first child follows its parent; 0: a leaf
  };

  explicit BoxTree(std::span<const Box> boxes);

  /// In depth-first order; the root comes first. Empty without boxes.
  std::span<const Node> nodes() const { return nodes_; }
  /// Indices of the boxes; a node's are order()[begin .. end).
  std::span<const uint32_t> order() const { return order_; }

  /// Calls visit(box index) for every box whose node and ancestors pass keep(distance), in an order
  /// that visits the children nearer to `point` first; keep is asked just before a node is entered.
  template <typename Keep, typename Visit>
  void ForEachNearestFirst(const Eigen::Vector3d& point, Keep keep, Visit visit) const {
    struct Entry {
      uint32_t node;
      double distance;
    };
    if (nodes_.empty()) return;
    std::array<Entry, 2 * kMaxDepth> stack;
    size_t size = 0;
    stack[size++] = {0, nodes_[0].box.DistanceTo(point)};
    while (size > 0) {
      const Entry entry = stack[--size];
      if (!keep(entry.distance)) continue;
      const Node& node = nodes_[entry.node];
      if (node.second_child == 0) {
        for (uint32_t i = node.begin; i < node.end; ++i) visit(order_[i]);
        continue;
      }
      Entry near = {entry.node + 1, nodes_[entry.node + 1].box.DistanceTo(point)};
      Entry far = {node.second_child, nodes_[node.second_child].box.DistanceTo(point)};
      if (far.distance < near.distance) std::swap(near, far);
      stack[size++] = far;
      stack[size++] = near;
    }
  }

 private:
  static constexpr size_t kMaxDepth = 40;

  void Build(std::span<const Box> boxes, uint32_t begin, uint32_t end);

  std::vector<Node> nodes_;
  std::vector<uint32_t> order_;
};

}  // namespace plumb
