// A session: camera frames with priors go in, refined poses come out, in the same order.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "plumb/base/result.h"
#include "plumb/features/image_view.h"
#include "plumb/features/line_detector.h"
#include "plumb/features/segment_refiner.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/map/map_index.h"
#include "plumb/runtime/frame_result.h"
#include "plumb/runtime/pose_refiner.h"
#include "plumb/runtime/stream_policy.h"

namespace plumb {

enum class SessionMode {
  kIndependent,  // every frame is refined from its own prior
  kStream,       // priors are a tracker's poses; corrections are carried on (stream_tracker.h)
};

/// What Submit() does while another frame waits for the detector.
enum class FramePolicy {
  kNewest,  // takes its place; the older frame is reported as kDropped
  kBlock,   // waits until there is room
};

struct SessionOptions {
  SessionMode mode = SessionMode::kIndependent;
  FramePolicy policy = FramePolicy::kNewest;
  PoseRefinerOptions refiner;
  SegmentRefinerOptions segments;
  StreamOptions stream;
  /// Results that are kept until they are polled, 1..1024. When they are full, kNewest discards the
  /// oldest one and counts it, kBlock stops working until one is polled.
  uint32_t result_capacity = 16;
  /// A frame whose segments are found later than this after its submission is reported as kLate
  /// [ns]; 0: no deadline.
  int64_t deadline_ns = 0;
  /// Longest time that Submit() waits under kBlock [ns], up to 1e12; 0: no limit.
  int64_t submit_timeout_ns = 0;
  /// When set, gets every result, in order, on the session's thread and without a lock held;
  /// nothing is kept for Poll() and Wait(). Must not throw. May call Submit() under kNewest only.
  std::function<void(const FrameResult&)> on_result;

  /// Returns kInvalidArgument naming the first member that is out of range.
  Status Validate() const;
};

/// Borrowed for the duration of Submit(), except for the image when `release` is set.
struct SessionFrame {
  ImageView image;
  ImageCamera camera;        // of the image's size, with its lens
  int64_t timestamp_ns = 0;  // strictly increasing within a session
  PosePrior prior;
  /// Optional; other places where the camera may be (RefineInput::more_priors). In kStream they are
  /// tried when the stream has to be searched for; a stream that goes on does not ask them.
  std::span<const PosePrior> more_priors = {};
  /// Optional; in pixels of the image. Those that the lens cannot have imaged are left out.
  std::span<const PointMatch> points;
  uint64_t user_tag = 0;  // these two come back in the result
  uint32_t user_kind = 0;
  /// When set, the image is not copied: its planes must stay until the session has called this,
  /// once, from any thread and without a lock held (it may submit a frame); also when the frame is
  /// dropped or the session destroyed. Not called when Submit() does not accept the frame.
  void (*release)(void* user) = nullptr;
  void* release_user = nullptr;
};

enum class SubmitOutcome {
  kAccepted,
  kReplacedFrame,  // accepted; an older frame that waited is dropped
  kTimedOut,       // not accepted: there was no room within submit_timeout_ns
};

/// submitted = completed + dropped + late + failed + frames still inside.
struct SessionStats {
  uint64_t submitted = 0, completed = 0, dropped = 0, late = 0, failed = 0;
  uint64_t results_discarded = 0;  // results that were not polled in time
};

/// Has one worker thread. While the detector's device works on one frame, the worker refines the
/// frame before. After the first few frames of one size and kind, the session allocates nothing
/// itself on the way of a frame.
///
/// Submit() may be called by one thread while others call Poll(), Wait() and Stats(); the
/// destructor only when no call is running. It waits for the step that the worker is in, not for
/// the frames that wait: those give no result.
class Session {
 public:
  /// `index` is borrowed and must outlive the session.
  /// @return kInvalidArgument for bad options or a null detector.
  static Result<std::unique_ptr<Session>> Create(const MapIndex& index,
                                                 std::unique_ptr<LineDetector> detector,
                                                 const SessionOptions& options);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Every accepted frame gives exactly one result.
  /// @return kInvalidArgument naming the value for a broken frame; kDeviceLost once the detector's
  ///         device is gone. The session is as before then.
  Result<SubmitOutcome> Submit(const SessionFrame& frame);

  /// Takes the oldest result; its buffers are exchanged for those of `out_result`.
  /// @return false when there is none.
  bool Poll(FrameResult* out_result);
  /// The same, waiting for at most `timeout_ns`, and at most a day.
  bool Wait(int64_t timeout_ns, FrameResult* out_result);

  SessionStats Stats() const;

 private:
  struct Impl;
  explicit Session(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
