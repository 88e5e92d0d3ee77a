#include "plumb/map/box_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<Box> RandomBoxes(size_t count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> at(-5.0, 5.0), size(0.0, 2.0);
  std::vector<Box> boxes;
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d lower(at(rng), at(rng), at(rng));
    boxes.push_back({lower, lower + Eigen::Vector3d(size(rng), size(rng), size(rng))});
  }
  return boxes;
}

bool Encloses(const Box& outer, const Box& inner) {
  return (outer.lower.array() <= inner.lower.array()).all() &&
         (outer.upper.array() >= inner.upper.array()).all();
}

TEST(Box, MeasuresDistanceFromItsSurfaceAndZeroInside) {
  const Box box = {{-1, -2, -3}, {1, 2, 3}};
  EXPECT_EQ(box.DistanceTo({0.5, -1.5, 2.0}), 0.0);
  EXPECT_EQ(box.DistanceTo({4, 0, 0}), 3.0);
  EXPECT_DOUBLE_EQ(box.DistanceTo({4, 6, 3}), 5.0);
}

TEST(BoxTree, VisitsEveryBoxOnceWhenNothingIsPruned) {
  for (const size_t count : {1u, 2u, 4u, 5u, 9u, 100u, 1000u}) {
    const std::vector<Box> boxes = RandomBoxes(count, /*seed=*/1);
    const BoxTree tree(boxes);
    std::vector<uint32_t> visited, expected(count);
    tree.ForEachNearestFirst(
        {0.5, 1.0, -2.0}, [](double) { return true; }, [&](uint32_t i) { visited.push_back(i); });
    std::sort(visited.begin(), visited.end());
    std::iota(expected.begin(), expected.end(), 0u);
    EXPECT_EQ(visited, expected) << count;
  }
}

TEST(BoxTree, WithoutBoxesVisitsNothing) {
  const BoxTree tree({});
  EXPECT_THAT(tree.nodes(), IsEmpty());
  tree.ForEachNearestFirst(
      {0, 0, 0}, [](double) { return true; }, [](uint32_t) { FAIL(); });
}

TEST(BoxTree, EveryNodeEnclosesItsBoxes) {
  const std::vector<Box> boxes = RandomBoxes(777, /*seed=*/2);
  const BoxTree tree(boxes);
  for (const BoxTree::Node& node : tree.nodes()) {
    for (uint32_t i = node.begin; i < node.end; ++i) {
      ASSERT_TRUE(Encloses(node.box, boxes[tree.order()[i]]));
    }
  }
}

TEST(BoxTree, FindsTheNearestBoxByVisitingFewNodes) {
  const std::vector<Box> boxes = RandomBoxes(2000, /*seed=*/4);
  const BoxTree tree(boxes);
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> at(-6.0, 6.0);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector3d point(at(rng), at(rng), at(rng));
    double best = 1e9;
    size_t num_visited = 0;
    tree.ForEachNearestFirst(
        point, [&](double distance) { return distance < best; },
        [&](uint32_t i) {
          best = std::min(best, boxes[i].DistanceTo(point));
          ++num_visited;
        });
    double expected = 1e9;
    for (const Box& box : boxes) expected = std::min(expected, box.DistanceTo(point));
    EXPECT_EQ(best, expected);
    EXPECT_LT(num_visited, boxes.size() / 4);
  }
}

TEST(BoxTree, SplitsBoxesThatAllCoincide) {
  const std::vector<Box> boxes(1000, Box{{1, 1, 1}, {2, 2, 2}});
  const BoxTree tree(boxes);
  size_t largest_leaf = 0;
  for (const BoxTree::Node& node : tree.nodes()) {
    if (node.second_child == 0) {
      largest_leaf = std::max<size_t>(largest_leaf, node.end - node.begin);
    }
  }
  EXPECT_LE(largest_leaf, 4u);
}

TEST(BoxTree, IsTheSameForTheSameBoxes) {
  std::vector<Box> boxes = RandomBoxes(300, /*seed=*/6);
  boxes.insert(boxes.end(), boxes.begin(), boxes.end());  // ties
  const BoxTree a(boxes), b(boxes);
  EXPECT_TRUE(std::equal(a.order().begin(), a.order().end(), b.order().begin(), b.order().end()));
}

}  // namespace
}  // namespace plumb
