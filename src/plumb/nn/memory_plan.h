// Places buffers with known life times into one arena.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace plumb::nn {

/// A buffer that is needed from step `first` to step `last`, both included.
struct LiveRange {
  size_t bytes = 0;
  int first = 0;
  int last = 0;
};

struct MemoryPlan {
  std::vector<size_t> offsets;  ///< Of each range, in bytes, multiples of the alignment.
  size_t total_bytes = 0;
};

/// Offsets such that ranges which live at the same step never overlap. Largest first, each at the
/// lowest offset that fits (greedy by size); ties by index, so the result is reproducible.
/// @param alignment  at least 1.
MemoryPlan PlanMemory(std::span<const LiveRange> ranges, size_t alignment);

/// Live ranges from first to last use. @param steps  the buffers that each step touches, by index
/// into `bytes`; buffers that no step touches get last < first.
std::vector<LiveRange> LiveRanges(std::span<const std::vector<int>> steps,
                                  std::span<const size_t> bytes);

}  // namespace plumb::nn
