// When two accesses to memory need a barrier.
#include "plumb/gpu/hazard_tracker.h"

#include <gtest/gtest.h>

namespace plumb::gpu {
namespace {

const int kA = 0, kB = 0;  // Identities of two buffers.

BufferUse Read(uint64_t begin, uint64_t end, const void* buffer = &kA) {
  return {buffer, begin, end, false};
}
BufferUse Write(uint64_t begin, uint64_t end, const void* buffer = &kA) {
  return {buffer, begin, end, true};
}

bool NeedsBarrier(const BufferUse& earlier, const BufferUse& later) {
  HazardTracker tracker;
  tracker.Add({&earlier, 1});
  return tracker.NeedsBarrier({&later, 1});
}

TEST(HazardTracker, ReadAfterWriteWriteAfterReadAndWriteAfterWriteNeedABarrier) {
  EXPECT_TRUE(NeedsBarrier(Write(0, 64), Read(0, 64)));
  EXPECT_TRUE(NeedsBarrier(Read(0, 64), Write(0, 64)));
  EXPECT_TRUE(NeedsBarrier(Write(0, 64), Write(0, 64)));
}

TEST(HazardTracker, ReadAfterReadNeedsNone) {
  EXPECT_FALSE(NeedsBarrier(Read(0, 64), Read(0, 64)));
}

TEST(HazardTracker, OneCommonByteIsEnough) {
  EXPECT_TRUE(NeedsBarrier(Write(0, 64), Read(63, 128)));
  EXPECT_TRUE(NeedsBarrier(Write(63, 128), Read(0, 64)));
  EXPECT_TRUE(NeedsBarrier(Write(0, 128), Read(32, 64)));
}

TEST(HazardTracker, NeighbouringRangesAreIndependent) {
  EXPECT_FALSE(NeedsBarrier(Write(0, 64), Read(64, 128)));
  EXPECT_FALSE(NeedsBarrier(Write(64, 128), Read(0, 64)));
}

TEST(HazardTracker, DifferentBuffersAreIndependent) {
  EXPECT_FALSE(NeedsBarrier(Write(0, 64, &kA), Read(0, 64, &kB)));
}

TEST(HazardTracker, AfterABarrierNothingIsPending) {
  HazardTracker tracker;
  const BufferUse write = Write(0, 64), read = Read(0, 64);
  tracker.Add({&write, 1});
  tracker.Clear();
  EXPECT_FALSE(tracker.NeedsBarrier({&read, 1}));
}

}  // namespace
}  // namespace plumb::gpu
