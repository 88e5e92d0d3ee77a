#include "plumb/runtime/frame_queue.h"

#include <cassert>
#include <chrono>
#include <utility>

namespace plumb {

FrameQueue::FrameQueue(FramePolicy policy) : policy_(policy) {
  for (size_t i = 0; i < kNumSlots; ++i) free_[i] = &slots_[i];
}

FrameSlot* FrameQueue::BeginPush(int64_t timeout_ns) {
  std::unique_lock lock(mutex_);
  if (policy_ == FramePolicy::kBlock) {
    const auto has_room = [this] { return is_closed_ || waiting_ == nullptr; };
    if (timeout_ns == 0) {
      popped_.wait(lock, has_room);
    } else if (!popped_.wait_for(lock, std::chrono::nanoseconds(timeout_ns), has_room)) {
      return nullptr;
    }
  }
  if (is_closed_) return nullptr;
  assert(num_free_ > 0);
  return free_[--num_free_];
}

FrameSlot* FrameQueue::CommitPush(FrameSlot* slot) {
  FrameSlot* replaced = nullptr;
  {
    const std::scoped_lock lock(mutex_);
    // May throw, so first.
    if (waiting_ != nullptr) waiting_->dropped_before.push_back(waiting_->ticket);
    replaced = std::exchange(waiting_, slot);
    slot->dropped_before.clear();
    if (replaced != nullptr) std::swap(slot->dropped_before, replaced->dropped_before);
  }
  pushed_.notify_one();
  return replaced;
}

FrameSlot* FrameQueue::Pop() {
  FrameSlot* slot = nullptr;
  {
    std::unique_lock lock(mutex_);
    pushed_.wait(lock, [this] { return is_closed_ || waiting_ != nullptr; });
    if (is_closed_) return nullptr;
    slot = std::exchange(waiting_, nullptr);
  }
  popped_.notify_one();
  return slot;
}

FrameSlot* FrameQueue::TryPop() {
  FrameSlot* slot = nullptr;
  {
    const std::scoped_lock lock(mutex_);
    if (is_closed_ || waiting_ == nullptr) return nullptr;
    slot = std::exchange(waiting_, nullptr);
  }
  popped_.notify_one();
  return slot;
}

void FrameQueue::Recycle(FrameSlot* slot) {
  const std::scoped_lock lock(mutex_);
  assert(num_free_ < kNumSlots);
  free_[num_free_++] = slot;
}

void FrameQueue::Close() {
  {
    const std::scoped_lock lock(mutex_);
    is_closed_ = true;
  }
  pushed_.notify_all();
  popped_.notify_all();
}

bool FrameQueue::IsClosed() const {
  const std::scoped_lock lock(mutex_);
  return is_closed_;
}

FrameSlot* FrameQueue::Leftover() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(waiting_, nullptr);
}

}  // namespace plumb
