// Places buffers with known life times into one arena.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "plumb/nn/layer_plan.h"

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

/// Live range of every feature of a plan with the given sizes; step = index of the layer. The
/// plan's input lives from step 0, its output to the last step; unused features have last < first.
std::vector<LiveRange> FeatureLifetimes(const LayerPlan& plan, std::span<const size_t> bytes);

}  // namespace plumb::nn
