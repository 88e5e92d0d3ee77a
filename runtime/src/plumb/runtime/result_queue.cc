#include "plumb/runtime/result_queue.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace plumb {
namespace {

// A day: a longer wait would overflow the clock when it is added to the time.
constexpr int64_t kMaxWaitNs = int64_t{24} * 3600 * 1'000'000'000;

}  // namespace

ResultQueue::ResultQueue(size_t capacity, bool waits_when_full)
    : waits_when_full_(waits_when_full), ring_(capacity) {}

void ResultQueue::Push(FrameResult* result) {
  {
    std::unique_lock lock(mutex_);
    if (count_ == ring_.size() && waits_when_full_) {
      popped_.wait(lock, [this] { return is_closed_ || count_ < ring_.size(); });
    }
    if (is_closed_) return;
    if (count_ == ring_.size()) {
      first_ = (first_ + 1) % ring_.size();
      --count_;
      ++num_discarded_;
    }
    std::swap(*result, ring_[(first_ + count_) % ring_.size()]);
    ++count_;
  }
  pushed_.notify_one();
}

bool ResultQueue::PopLocked(FrameResult* out_result) {
  if (count_ == 0) return false;
  std::swap(*out_result, ring_[first_]);
  first_ = (first_ + 1) % ring_.size();
  --count_;
  return true;
}

bool ResultQueue::Poll(FrameResult* out_result) {
  {
    const std::scoped_lock lock(mutex_);
    if (!PopLocked(out_result)) return false;
  }
  popped_.notify_one();
  return true;
}

bool ResultQueue::Wait(int64_t timeout_ns, FrameResult* out_result) {
  {
    std::unique_lock lock(mutex_);
    pushed_.wait_for(lock, std::chrono::nanoseconds(std::min(timeout_ns, kMaxWaitNs)),
                     [this] { return is_closed_ || count_ > 0; });
    if (!PopLocked(out_result)) return false;
  }
  popped_.notify_one();
  return true;
}

void ResultQueue::Close() {
  {
    const std::scoped_lock lock(mutex_);
    is_closed_ = true;
  }
  pushed_.notify_all();
  popped_.notify_all();
}

uint64_t ResultQueue::num_discarded() const {
  const std::scoped_lock lock(mutex_);
  return num_discarded_;
}

}  // namespace plumb
