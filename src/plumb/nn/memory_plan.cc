// Greedy-by-size offset assignment.
#include "plumb/nn/memory_plan.h"

#include <algorithm>
#include <numeric>

namespace plumb::nn {

MemoryPlan PlanMemory(std::span<const LiveRange> ranges, size_t alignment) {
  const auto rounded = [alignment](size_t bytes) {
    return (bytes + alignment - 1) / alignment * alignment;
  };
  std::vector<size_t> order(ranges.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return ranges[a].bytes > ranges[b].bytes; });
  MemoryPlan plan;
  plan.offsets.assign(ranges.size(), 0);
  std::vector<size_t> placed;  // By offset.
  for (const size_t index : order) {
    const LiveRange& range = ranges[index];
    if (range.last < range.first) continue;
    size_t offset = 0;
    for (const size_t other : placed) {
      const LiveRange& taken = ranges[other];
      if (taken.last < range.first || range.last < taken.first) continue;
      if (plan.offsets[other] >= offset + range.bytes) break;
      offset = std::max(offset, rounded(plan.offsets[other] + taken.bytes));
    }
    plan.offsets[index] = offset;
    plan.total_bytes = std::max(plan.total_bytes, rounded(offset + range.bytes));
    placed.insert(
        std::upper_bound(placed.begin(), placed.end(), index,
                         [&](size_t a, size_t b) { return plan.offsets[a] < plan.offsets[b]; }),
        index);
  }
  return plan;
}

std::vector<LiveRange> LiveRanges(std::span<const std::vector<int>> steps,
                                  std::span<const size_t> bytes) {
  const int num_steps = static_cast<int>(steps.size());
  std::vector<LiveRange> ranges(bytes.size());
  for (size_t i = 0; i < ranges.size(); ++i) {
    ranges[i] = {.bytes = bytes[i], .first = num_steps, .last = -1};
  }
  for (int step = 0; step < num_steps; ++step) {
    for (const int buffer : steps[step]) {
      ranges[buffer].first = std::min(ranges[buffer].first, step);
      ranges[buffer].last = std::max(ranges[buffer].last, step);
    }
  }
  return ranges;
}

}  // namespace plumb::nn
