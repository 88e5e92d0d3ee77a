// What a session gives back for one frame.
#pragma once

#include <cstdint>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/geometry/segment.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// What a session did with a frame. Only kProcessed has gone through the refiner; all others
/// return the prior.
enum class FrameOutcome {
  kProcessed,
  kDropped,  // a newer frame took its place before its turn came
  kLate,     // its lines were found after the deadline; it was not refined
  kFailed,   // FrameResult::error says why
};

/// [ns]. Stages that a frame did not reach are 0.
struct StageTimes {
  int64_t wait_ns = 0;    // from submission until the detector took the frame
  int64_t detect_ns = 0;  // from then until its segments were there; overlaps the frame before
  int64_t ridge_ns = 0;   // moving the segments on to the image's edges
  int64_t search_ns = 0;
  int64_t match_and_refine_ns = 0;
  int64_t total_ns = 0;  // from submission until the result was there
};

struct FrameResult {
  uint64_t frame_index = 0;  // counts the frames that the session accepted, from 0
  int64_t timestamp_ns = 0;
  uint64_t user_tag = 0;
  uint32_t user_kind = 0;
  FrameOutcome outcome = FrameOutcome::kFailed;
  Error error;            // of kFailed
  bool searched = false;  // the refinement needed a search over the prior's uncertainty
  PosePrior prior;        // as submitted
  RefineResult refined;   // its pose is good whatever the outcome: at worst the prior
  /// On the image's edges [px of the ideal image, that is without the lens]; RefineResult::matches
  /// index them.
  std::vector<Segment2> segments;
  StageTimes times;
};

}  // namespace plumb
