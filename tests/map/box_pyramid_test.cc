#include "plumb/map/box_pyramid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "support/allocation_counter.h"

namespace plumb {
namespace {

struct Scene {
  std::vector<Box> boxes;
  std::vector<float> reach;
};

Scene RandomScene(size_t count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> at(-20.0, 20.0), side(0.0, 1.0);
  Scene scene;
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d lower(at(rng), 0.1 * at(rng), at(rng));
    scene.boxes.push_back({lower, lower + Eigen::Vector3d(side(rng), side(rng), side(rng))});
    scene.reach.push_back(static_cast<float>(5.0 * side(rng)));
  }
  return scene;
}

BoxQuery RandomQuery(std::mt19937* rng) {
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Eigen::Vector3d(normal(*rng), normal(*rng), normal(*rng)); };
  BoxQuery query;
  query.center = 8.0 * vector();
  for (size_t p = 0; p < BoxQuery::kPlanes; ++p) {
    query.normals[p] = vector().normalized();
    query.offsets[p] = 4.0 - query.normals[p].dot(query.center);
  }
  query.reach_factor = 2.0;
  return query;
}

bool Touches(const Box& box, float reach, const BoxQuery& query) {
  for (size_t p = 0; p < BoxQuery::kPlanes; ++p) {
    const Eigen::Vector3d& normal = query.normals[p];
    const double farthest =
        normal.cwiseProduct(box.lower).cwiseMax(normal.cwiseProduct(box.upper)).sum();
    if (farthest + query.offsets[p] < 0.0) return false;
  }
  return box.DistanceTo(query.center) <= query.reach_factor * static_cast<double>(reach);
}

TEST(BoxPyramid, FindsWhatThePlainLoopOverItsLeavesFinds) {
  std::mt19937 rng(1);
  for (const size_t count : {1u, 7u, 8u, 9u, 64u, 65u, 500u, 3000u}) {
    const Scene scene = RandomScene(count, 2);
    const BoxPyramid pyramid(scene.boxes, scene.reach);
    std::vector<uint32_t> found, expected;
    for (int trial = 0; trial < 100; ++trial) {
      const BoxQuery query = RandomQuery(&rng);
      pyramid.Find(query, &found);
      pyramid.FindPlainly(query, &expected);
      ASSERT_EQ(found, expected) << count << " boxes, trial " << trial;
    }
  }
}

TEST(BoxPyramid, MissesNoItemThatTouches) {
  std::mt19937 rng(3);
  const Scene scene = RandomScene(2000, 4);
  const BoxPyramid pyramid(scene.boxes, scene.reach);
  std::vector<uint32_t> leaves;
  size_t num_touching = 0, num_candidates = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const BoxQuery query = RandomQuery(&rng);
    pyramid.Find(query, &leaves);
    num_candidates += leaves.size() * BoxPyramid::kFan;
    for (size_t i = 0; i < pyramid.order().size(); ++i) {
      const uint32_t item = pyramid.order()[i];
      if (!Touches(scene.boxes[item], scene.reach[item], query)) continue;
      ++num_touching;
      EXPECT_TRUE(std::binary_search(leaves.begin(), leaves.end(), i / BoxPyramid::kFan));
    }
  }
  EXPECT_GT(num_touching, 1000u);
  EXPECT_LT(num_candidates, 100u * 2000u / 2);
}

TEST(BoxPyramid, OrdersEveryItemOnceAndAlike) {
  const Scene scene = RandomScene(777, 5);
  const BoxPyramid a(scene.boxes, scene.reach), b(scene.boxes, scene.reach);
  std::vector<uint32_t> sorted(a.order().begin(), a.order().end());
  EXPECT_TRUE(std::equal(sorted.begin(), sorted.end(), b.order().begin(), b.order().end()));
  std::sort(sorted.begin(), sorted.end());
  std::vector<uint32_t> all(777);
  std::iota(all.begin(), all.end(), 0u);
  EXPECT_EQ(sorted, all);
}

TEST(BoxPyramid, WithoutBoxesFindsNothing) {
  const BoxPyramid pyramid({}, {});
  std::mt19937 rng(6);
  std::vector<uint32_t> found = {3};
  pyramid.Find(RandomQuery(&rng), &found);
  EXPECT_TRUE(found.empty());
}

TEST(BoxPyramid, DoesNotAllocateOnceWarm) {
  const Scene scene = RandomScene(5000, 7);
  const BoxPyramid pyramid(scene.boxes, scene.reach);
  std::mt19937 rng(8);
  const BoxQuery query = RandomQuery(&rng);
  std::vector<uint32_t> found;
  pyramid.Find(query, &found);
  pyramid.Find(query, &found);
  const size_t before = testing::num_allocations;
  for (int i = 0; i < 10; ++i) pyramid.Find(query, &found);
  EXPECT_EQ(testing::num_allocations, before);
}

}  // namespace
}  // namespace plumb
