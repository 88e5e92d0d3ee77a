// Finds out which recorded accesses to memory need a barrier between them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace plumb::gpu {

/// Bytes [begin, end) of a buffer that one call reads or writes.
struct BufferUse {
  const void* buffer = nullptr;  // identity only
  uint64_t begin_bytes = 0, end_bytes = 0;
  bool is_write = false;
};

/// True if the two touch common bytes and at least one of them writes.
bool Conflict(const BufferUse& a, const BufferUse& b);

/// Remembers the uses since the last barrier.
class HazardTracker {
 public:
  /// True if one of `uses` conflicts with a remembered one.
  bool NeedsBarrier(std::span<const BufferUse> uses) const;
  void Add(std::span<const BufferUse> uses);
  /// A barrier that orders all memory accesses was recorded.
  void Clear() { uses_.clear(); }

 private:
  std::vector<BufferUse> uses_;
};

}  // namespace plumb::gpu
