// The ring of results: order, overflow, waiting.
#include "plumb/runtime/result_queue.h"

#include <thread>

#include <gtest/gtest.h>

namespace plumb {
namespace {

constexpr int64_t kMillisecondNs = 1'000'000;
constexpr int64_t kSecondNs = 1'000'000'000;

void Push(ResultQueue* queue, uint64_t index) {
  FrameResult result;
  result.frame_index = index;
  queue->Push(&result);
}

TEST(ResultQueue, GivesResultsInTheirOrder) {
  ResultQueue queue(3, false);
  FrameResult result;
  EXPECT_FALSE(queue.Poll(&result));
  for (uint64_t i = 0; i < 3; ++i) Push(&queue, i);
  for (uint64_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(queue.Poll(&result));
    EXPECT_EQ(result.frame_index, i);
  }
  EXPECT_FALSE(queue.Poll(&result));
}

TEST(ResultQueue, DiscardsTheOldestWhenFullAndCountsIt) {
  ResultQueue queue(2, false);
  for (uint64_t i = 0; i < 5; ++i) Push(&queue, i);
  EXPECT_EQ(queue.num_discarded(), 3u);
  FrameResult result;
  ASSERT_TRUE(queue.Poll(&result));
  EXPECT_EQ(result.frame_index, 3u);
  ASSERT_TRUE(queue.Poll(&result));
  EXPECT_EQ(result.frame_index, 4u);
}

TEST(ResultQueue, WaitingRingLosesNothing) {
  constexpr uint64_t kNumResults = 200;
  ResultQueue queue(1, true);
  std::thread producer([&] {
    for (uint64_t i = 0; i < kNumResults; ++i) Push(&queue, i);
  });
  FrameResult result;
  for (uint64_t i = 0; i < kNumResults; ++i) {
    ASSERT_TRUE(queue.Wait(10 * kSecondNs, &result));
    EXPECT_EQ(result.frame_index, i);
  }
  producer.join();
  EXPECT_EQ(queue.num_discarded(), 0u);
}

TEST(ResultQueue, WaitTimesOut) {
  ResultQueue queue(1, false);
  FrameResult result;
  EXPECT_FALSE(queue.Wait(kMillisecondNs, &result));
  EXPECT_FALSE(queue.Wait(0, &result));
}

TEST(ResultQueue, CloseWakesBothSides) {
  ResultQueue full(1, true), empty(1, true);
  Push(&full, 0);
  std::thread producer([&] { Push(&full, 1); });
  FrameResult result;
  bool got = true;
  std::thread consumer([&] { got = empty.Wait(100 * kSecondNs, &result); });
  full.Close();
  empty.Close();
  producer.join();
  consumer.join();
  EXPECT_FALSE(got);
}

TEST(ResultQueue, BuffersAreExchangedNotCopied) {
  ResultQueue queue(1, false);
  FrameResult result;
  result.segments.resize(10);
  const Segment2* data = result.segments.data();
  queue.Push(&result);
  FrameResult polled;
  ASSERT_TRUE(queue.Poll(&polled));
  EXPECT_EQ(polled.segments.data(), data);
}

}  // namespace
}  // namespace plumb
