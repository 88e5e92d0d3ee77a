// Results that wait to be polled: a ring of fixed size whose buffers are exchanged, never copied.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <vector>

#include "plumb/runtime/frame_result.h"

namespace plumb {

/// Thread-safe.
class ResultQueue {
 public:
  /// `capacity` >= 1. When full, Push() discards the oldest result, or waits if `waits_when_full`.
  ResultQueue(size_t capacity, bool waits_when_full);

  /// Exchanges `result` for an empty one. Does nothing once closed.
  void Push(FrameResult* result);

  /// Takes the oldest result. @return false when there is none.
  bool Poll(FrameResult* out_result);
  /// The same, waiting for at most `timeout_ns`; at once when closed.
  bool Wait(int64_t timeout_ns, FrameResult* out_result);

  void Close();
  uint64_t num_discarded() const;

 private:
  bool PopLocked(FrameResult* out_result);

  mutable std::mutex mutex_;
  std::condition_variable pushed_, popped_;
  const bool waits_when_full_;
  bool is_closed_ = false;
  std::vector<FrameResult> ring_;
  size_t first_ = 0, count_ = 0;
  uint64_t num_discarded_ = 0;
};

}  // namespace plumb
