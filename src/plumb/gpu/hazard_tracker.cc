#include "plumb/gpu/hazard_tracker.h"

namespace plumb::gpu {

bool Conflict(const BufferUse& a, const BufferUse& b) {
  return a.buffer == b.buffer && (a.is_write || b.is_write) && a.begin_bytes < b.end_bytes &&
         b.begin_bytes < a.end_bytes;
}

bool HazardTracker::NeedsBarrier(std::span<const BufferUse> uses) const {
  for (const BufferUse& use : uses) {
    for (const BufferUse& earlier : uses_) {
      if (Conflict(use, earlier)) return true;
    }
  }
  return false;
}

void HazardTracker::Add(std::span<const BufferUse> uses) {
  uses_.insert(uses_.end(), uses.begin(), uses.end());
}

}  // namespace plumb::gpu
