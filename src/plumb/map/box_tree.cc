#include "plumb/map/box_tree.h"

#include <algorithm>
#include <numeric>

namespace plumb {
namespace {

constexpr uint32_t kLeafSize = 4;

}  // namespace

BoxTree::BoxTree(std::span<const Box> boxes) : order_(boxes.size()) {
  std::iota(order_.begin(), order_.end(), 0u);
  if (boxes.empty()) return;
  nodes_.reserve(boxes.size());
  Build(boxes, 0, static_cast<uint32_t>(boxes.size()));
}

void BoxTree::Build(std::span<const Box> boxes, uint32_t begin, uint32_t end) {
  const auto self = static_cast<uint32_t>(nodes_.size());
  nodes_.push_back({boxes[order_[begin]], begin, end, 0});
  Box& box = nodes_[self].box;
  // Twice the centres; the factor does not matter for the order.
  Box centers = {box.lower + box.upper, box.lower + box.upper};
  for (uint32_t i = begin; i < end; ++i) {
    const Box& item = boxes[order_[i]];
    box.Extend(item);
    centers.Extend({item.lower + item.upper, item.lower + item.upper});
  }
  if (end - begin > kLeafSize) {
    Eigen::Index axis = 0;
    (centers.upper - centers.lower).maxCoeff(&axis);
    const uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](uint32_t a, uint32_t b) {
                       const double center_a = boxes[a].lower[axis] + boxes[a].upper[axis];
                       const double center_b = boxes[b].lower[axis] + boxes[b].upper[axis];
                       return center_a != center_b ? center_a < center_b : a < b;
                     });
    Build(boxes, begin, middle);
    nodes_[self].second_child = static_cast<uint32_t>(nodes_.size());
    Build(boxes, middle, end);
  }
}

}  // namespace plumb
