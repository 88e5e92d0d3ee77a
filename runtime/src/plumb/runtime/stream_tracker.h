// Refines a stream: the correction of one frame is carried to the next, a search is the exception.
#pragma once

#include "plumb/base/result.h"
#include "plumb/runtime/pose_refiner.h"
#include "plumb/runtime/stream_policy.h"

namespace plumb {

/// Refines the frames of one stream in their order, with priors that are a tracker's poses: right
/// from frame to frame, drifting in the long run. A frame is refined locally around the prediction;
/// when that fails or explains much less than usual, it is searched at once, and once more from the
/// tracker's own pose if that is no better: a host that relocalised leaves the correction behind
/// (stream_policy.h).
/// Not thread-safe.
/// Source: docs/method/association.md, "Stream".
class StreamTracker {
 public:
  /// `refiner` is borrowed and must outlive the tracker. `options` must be valid.
  explicit StreamTracker(PoseRefiner* refiner, const StreamOptions& options = {});

  /// @param input       As for PoseRefiner::Refine; `prior` is the tracker's pose with the
  ///                    uncertainty of its drift, `search` is ignored. `more_priors` are tried
  ///                    when the stream has to be searched for.
  /// @param out_result  `cam_from_world` is the corrected prediction where there is nothing better,
  ///                    not the tracker's pose. Its times and stages are those of all that was
  ///                    tried; a time budget is the frame's, not of each of them.
  /// @return what PoseRefiner::Refine returns; after an error the stream is as it was before.
  Status Track(const RefineInput& input, RefineResult* out_result);

  const StreamState& state() const { return state_; }
  /// Whether the last Track() needed the search.
  bool searched() const { return searched_; }

 private:
  /// PoseRefiner::Refine, with what it spends added up in `spent_`.
  Status Refine(const RefineInput& input, RefineResult* out_result);
  Status Search(const RefineInput& input, const Deadline& deadline, RefineResult* out_result);

  PoseRefiner* refiner_;
  StreamOptions options_;
  StreamState state_;
  RefineResult second_;  // keeps its memory
  struct {
    int64_t search_ns = 0, match_and_refine_ns = 0, total_ns = 0;
    RefineStages stages;
  } spent_;  // on the frame at hand
  bool searched_ = false;
};

}  // namespace plumb
