// The waiting place: who is replaced, who waits, and that nobody waits for ever.
#include "plumb/runtime/frame_queue.h"

#include <chrono>
#include <thread>

#include <gtest/gtest.h>

namespace plumb {
namespace {

constexpr int64_t kMillisecondNs = 1'000'000;

FrameSlot* Push(FrameQueue* queue, uint64_t index, FrameSlot** replaced = nullptr) {
  FrameSlot* slot = queue->BeginPush(0);
  if (slot == nullptr) return nullptr;
  slot->ticket.index = index;
  FrameSlot* old = queue->CommitPush(slot);
  if (replaced != nullptr) *replaced = old;
  if (old != nullptr) queue->Recycle(old);
  return slot;
}

TEST(FrameQueue, GivesTheWaitingFrame) {
  FrameQueue queue(FramePolicy::kNewest);
  EXPECT_EQ(queue.TryPop(), nullptr);
  FrameSlot* slot = Push(&queue, 7);
  EXPECT_EQ(queue.TryPop(), slot);
  EXPECT_EQ(queue.TryPop(), nullptr);
  EXPECT_EQ(slot->ticket.index, 7u);
  EXPECT_TRUE(slot->dropped_before.empty());
}

TEST(FrameQueue, NewestFrameReplacesTheWaitingOneAndRemembersIt) {
  FrameQueue queue(FramePolicy::kNewest);
  FrameSlot* replaced = nullptr;
  FrameSlot* first = Push(&queue, 0, &replaced);
  EXPECT_EQ(replaced, nullptr);
  Push(&queue, 1, &replaced);
  EXPECT_EQ(replaced, first);
  Push(&queue, 2, &replaced);
  FrameSlot* slot = queue.Pop();
  ASSERT_NE(slot, nullptr);
  EXPECT_EQ(slot->ticket.index, 2u);
  ASSERT_EQ(slot->dropped_before.size(), 2u);
  EXPECT_EQ(slot->dropped_before[0].index, 0u);
  EXPECT_EQ(slot->dropped_before[1].index, 1u);
}

TEST(FrameQueue, RecycledSlotForgetsWhatItDropped) {
  FrameQueue queue(FramePolicy::kNewest);
  for (uint64_t i = 0; i < 50; i += 2) {
    Push(&queue, i);
    Push(&queue, i + 1);
    FrameSlot* slot = queue.TryPop();
    ASSERT_NE(slot, nullptr);
    ASSERT_EQ(slot->dropped_before.size(), 1u);
    EXPECT_EQ(slot->dropped_before[0].index, i);
    queue.Recycle(slot);
  }
}

TEST(FrameQueue, BlockingPushTimesOutWhileAFrameWaits) {
  FrameQueue queue(FramePolicy::kBlock);
  Push(&queue, 0);
  EXPECT_EQ(queue.BeginPush(kMillisecondNs), nullptr);
  EXPECT_NE(queue.TryPop(), nullptr);
  EXPECT_NE(queue.BeginPush(kMillisecondNs), nullptr);
}

TEST(FrameQueue, BlockingPushGoesOnWhenTheFrameIsTaken) {
  FrameQueue queue(FramePolicy::kBlock);
  Push(&queue, 0);
  std::thread consumer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    queue.Recycle(queue.Pop());
  });
  EXPECT_NE(Push(&queue, 1), nullptr);
  consumer.join();
  EXPECT_EQ(queue.TryPop()->ticket.index, 1u);
}

TEST(FrameQueue, CloseWakesAWaitingPop) {
  FrameQueue queue(FramePolicy::kNewest);
  FrameSlot* popped = nullptr;
  std::thread consumer([&] { popped = queue.Pop(); });
  queue.Close();
  consumer.join();
  EXPECT_EQ(popped, nullptr);
}

TEST(FrameQueue, CloseWakesAWaitingPush) {
  FrameQueue queue(FramePolicy::kBlock);
  Push(&queue, 0);
  FrameSlot* pushed = queue.Leftover();
  queue.CommitPush(pushed);
  std::thread producer([&] { pushed = queue.BeginPush(0); });
  queue.Close();
  producer.join();
  EXPECT_EQ(pushed, nullptr);
}

TEST(FrameQueue, ClosedQueueKeepsItsFrameAsLeftoverOnly) {
  FrameQueue queue(FramePolicy::kNewest);
  FrameSlot* slot = Push(&queue, 3);
  queue.Close();
  EXPECT_TRUE(queue.IsClosed());
  EXPECT_EQ(queue.Pop(), nullptr);
  EXPECT_EQ(queue.TryPop(), nullptr);
  EXPECT_EQ(queue.BeginPush(0), nullptr);
  EXPECT_EQ(queue.Leftover(), slot);
  EXPECT_EQ(queue.Leftover(), nullptr);
}

TEST(FrameQueue, EveryFrameOfAFastProducerIsTakenOrDroppedOnce) {
  constexpr uint64_t kNumFrames = 2000;
  FrameQueue queue(FramePolicy::kNewest);
  uint64_t next = 0;
  bool in_order = true;
  std::thread consumer([&] {
    while (next < kNumFrames) {
      FrameSlot* slot = queue.Pop();
      if (slot == nullptr) return;
      for (const FrameTicket& ticket : slot->dropped_before) in_order &= ticket.index == next++;
      in_order &= slot->ticket.index == next++;
      queue.Recycle(slot);
    }
  });
  for (uint64_t i = 0; i < kNumFrames; ++i) ASSERT_NE(Push(&queue, i), nullptr);
  consumer.join();
  EXPECT_TRUE(in_order);
  EXPECT_EQ(next, kNumFrames);
}

}  // namespace
}  // namespace plumb
