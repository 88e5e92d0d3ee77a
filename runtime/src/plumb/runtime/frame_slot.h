// One submitted frame on its way through a session, with its own copy of everything.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/features/image_view.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/segment.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

struct SessionFrame;

/// What must be remembered of a frame to report it.
struct FrameTicket {
  uint64_t index = 0;
  int64_t timestamp_ns = 0;
  uint64_t user_tag = 0;
  uint32_t user_kind = 0;
  PosePrior prior;
  int64_t submitted_ns = 0;  // of the session's own clock
};

/// Gives a borrowed image back; a default one has nothing to give.
struct ImageRelease {
  void (*callback)(void* user) = nullptr;
  void* user = nullptr;

  void operator()() const {
    if (callback != nullptr) callback(user);
  }
};

/// Slots are recycled: their vectors keep their capacity.
struct FrameSlot {
  FrameTicket ticket;
  std::vector<PosePrior> more_priors;
  Rectifier rectifier;             // of the frame's camera
  std::vector<PointMatch> points;  // in pixels of its ideal image
  ImageView image;                 // of `pixels`, or the host's own planes until they are released
  std::vector<uint8_t> pixels;
  ImageRelease release;
  std::vector<FrameTicket> dropped_before;  // frames whose place this one took, oldest first

  Status detection = Ok();
  std::vector<Segment2> detected;
  int64_t detect_begin_ns = 0, detect_end_ns = 0;

  /// Takes the frame over; copies the image unless it comes with a release callback. `frame` must
  /// be valid and `frame_rectifier` of its camera. Leaves `ticket.index` and `dropped_before`
  /// alone.
  void Assign(const SessionFrame& frame, const Rectifier& frame_rectifier, int64_t now_ns);

  /// Gives a borrowed image back, once; does nothing for a copied one.
  void ReleaseImage() { TakeRelease()(); }
  /// What will give it back, for callers that have to leave a lock first.
  ImageRelease TakeRelease() { return std::exchange(release, {}); }
};

/// kInvalidArgument naming the first value of the frame that is broken.
Status ValidateFrame(const SessionFrame& frame);

}  // namespace plumb
