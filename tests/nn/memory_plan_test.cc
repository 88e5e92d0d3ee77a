// Buffers that live at the same time never share bytes.
#include "plumb/nn/memory_plan.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "plumb/nn/layer_plan.h"

namespace plumb::nn {
namespace {

size_t PeakBytes(std::span<const LiveRange> ranges, int num_steps) {
  size_t peak = 0;
  for (int step = 0; step < num_steps; ++step) {
    size_t live = 0;
    for (const LiveRange& range : ranges) {
      if (range.first <= step && step <= range.last) live += range.bytes;
    }
    peak = std::max(peak, live);
  }
  return peak;
}

void ExpectNoOverlap(std::span<const LiveRange> ranges, const MemoryPlan& plan, size_t alignment) {
  ASSERT_EQ(plan.offsets.size(), ranges.size());
  for (size_t a = 0; a < ranges.size(); ++a) {
    if (ranges[a].last < ranges[a].first) continue;
    EXPECT_EQ(plan.offsets[a] % alignment, 0u);
    EXPECT_LE(plan.offsets[a] + ranges[a].bytes, plan.total_bytes);
    for (size_t b = 0; b < a; ++b) {
      if (ranges[b].last < ranges[b].first) continue;
      const bool together = ranges[a].first <= ranges[b].last && ranges[b].first <= ranges[a].last;
      const bool shared = plan.offsets[a] < plan.offsets[b] + ranges[b].bytes &&
                          plan.offsets[b] < plan.offsets[a] + ranges[a].bytes;
      EXPECT_FALSE(together && shared) << a << " and " << b;
    }
  }
}

TEST(MemoryPlan, RandomLifetimesNeverOverlap) {
  uint32_t state = 1;
  const auto next = [&state](uint32_t limit) {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % limit;
  };
  for (int round = 0; round < 200; ++round) {
    const int num_steps = 1 + next(40);
    std::vector<LiveRange> ranges(1 + next(60));
    for (LiveRange& range : ranges) {
      range.bytes = 1 + next(round % 2 == 0 ? 10 : 100000);
      range.first = next(num_steps);
      range.last = std::min<int>(num_steps - 1, range.first + next(8));
    }
    const size_t alignment = size_t{1} << next(9);
    const MemoryPlan plan = PlanMemory(ranges, alignment);
    ExpectNoOverlap(ranges, plan, alignment);
    EXPECT_GE(plan.total_bytes, PeakBytes(ranges, num_steps));
  }
}

TEST(MemoryPlan, DisjointLifetimesShareTheSameBytes) {
  const std::vector<LiveRange> ranges = {{100, 0, 1}, {100, 2, 3}, {100, 4, 5}};
  EXPECT_EQ(PlanMemory(ranges, 1).total_bytes, 100u);
}

TEST(MemoryPlan, RangesThatTouchInOneStepAreApart) {
  const std::vector<LiveRange> ranges = {{100, 0, 1}, {100, 1, 2}};
  EXPECT_EQ(PlanMemory(ranges, 1).total_bytes, 200u);
}

TEST(MemoryPlan, NothingNeedsNoMemory) {
  EXPECT_EQ(PlanMemory({}, 64).total_bytes, 0u);
  const std::vector<LiveRange> unused = {{100, 3, -1}};
  EXPECT_EQ(PlanMemory(unused, 64).total_bytes, 0u);
}

TEST(MemoryPlan, TheNetworksArenaIsCloseToItsPeak) {
  const LayerPlan plan = BuildLayerPlan(RandomModel(ModelSpec(), 1), 320, 320);
  std::vector<size_t> bytes;
  size_t sum = 0;
  for (const Feature& feature : plan.features) {
    bytes.push_back(static_cast<size_t>(feature.channels) * feature.height * feature.width * 4);
    sum += bytes.back();
  }
  std::vector<std::vector<int>> steps;
  for (const Layer& layer : plan.layers) {
    steps.emplace_back();
    for (const int feature :
         {layer.input, layer.extra_input, layer.residual, layer.upsampled, layer.output}) {
      if (feature >= 0) steps.back().push_back(feature);
    }
  }
  const auto ranges = LiveRanges(steps, bytes);
  const MemoryPlan memory = PlanMemory(ranges, 256);
  ExpectNoOverlap(ranges, memory, 256);
  const size_t peak = PeakBytes(ranges, static_cast<int>(steps.size()));
  EXPECT_LE(memory.total_bytes, peak + peak / 4);
  EXPECT_LT(memory.total_bytes, sum / 3);
}

TEST(MemoryPlan, LiveRangesSpanFirstToLastUse) {
  const std::vector<std::vector<int>> steps = {{0, 1}, {1, 2}, {2, 1, 3}};
  const std::vector<size_t> bytes = {4, 4, 4, 4, 4};
  const auto ranges = LiveRanges(steps, bytes);
  EXPECT_EQ(ranges[1].first, 0);
  EXPECT_EQ(ranges[1].last, 2);
  EXPECT_EQ(ranges[2].first, 1);
  EXPECT_EQ(ranges[2].last, 2);
  EXPECT_EQ(ranges[3].first, 2);
  EXPECT_LT(ranges[4].last, ranges[4].first);
}

}  // namespace
}  // namespace plumb::nn
