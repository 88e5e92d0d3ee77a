// The waiting place in front of a session's detector, and the slots that frames travel in.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <mutex>

#include "plumb/runtime/frame_slot.h"
#include "plumb/runtime/session.h"

namespace plumb {

/// At most one frame waits. Thread-safe for one thread that pushes and one that pops.
class FrameQueue {
 public:
  explicit FrameQueue(FramePolicy policy);

  /// A slot to fill, which must go to CommitPush(). Under kBlock waits until no frame waits, for at
  /// most `timeout_ns` (0: for ever). @return nullptr after the time-out or when closed.
  FrameSlot* BeginPush(int64_t timeout_ns);

  /// The slot's frame waits now. When memory is out, std::bad_alloc is thrown and nothing changes.
  /// @return the slot of the frame that it replaced, or nullptr. That frame is in the new one's
  ///         `dropped_before`; its slot must go to Recycle() after its image was released.
  FrameSlot* CommitPush(FrameSlot* slot);

  /// The waiting frame. Pop() waits for one. @return nullptr when there is none or when closed.
  FrameSlot* Pop();
  FrameSlot* TryPop();

  void Recycle(FrameSlot* slot);

  /// Wakes every waiting call; from now on all of them return nullptr.
  void Close();
  bool IsClosed() const;

  /// The frame that still waits after Close(), or nullptr.
  FrameSlot* Leftover();

 private:
  // One being filled, one waiting, one in the detector, one being refined; one being replaced.
  static constexpr size_t kNumSlots = 5;

  mutable std::mutex mutex_;
  std::condition_variable pushed_, popped_;
  const FramePolicy policy_;
  bool is_closed_ = false;
  FrameSlot* waiting_ = nullptr;
  std::array<FrameSlot, kNumSlots> slots_;
  std::array<FrameSlot*, kNumSlots> free_;
  size_t num_free_ = kNumSlots;
};

}  // namespace plumb
