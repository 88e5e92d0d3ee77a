#include "plumb/runtime/session.h"

#include <atomic>
#include <chrono>
#include <exception>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "plumb/refine/uncertainty.h"
#include "plumb/runtime/frame_queue.h"
#include "plumb/runtime/result_queue.h"
#include "plumb/runtime/stream_tracker.h"

namespace plumb {
namespace {

constexpr uint32_t kMaxResultCapacity = 1024;
constexpr int64_t kMaxSubmitTimeoutNs = 1'000'000'000'000;

int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// Short enough to need no memory itself.
Error OutOfMemory() { return {ErrorCode::kOutOfMemory, "out of memory"}; }

Error Failed(const char* what) {
  try {
    return {ErrorCode::kInternal, std::string("Session: a frame failed: ") + what};
  } catch (const std::bad_alloc&) {
    return OutOfMemory();
  }
}

// The worker must survive whatever is thrown below it.
template <typename Fn>
Status Contain(Fn&& fn) {
  try {
    return fn();
  } catch (const std::bad_alloc&) {
    return OutOfMemory();
  } catch (const std::exception& e) {
    return Failed(e.what());
  } catch (...) {
    return Failed("unknown exception");
  }
}

}  // namespace

Status SessionOptions::Validate() const {
  const auto invalid = [](const char* name, int64_t value, const char* range) -> Status {
    return Error{ErrorCode::kInvalidArgument, std::string("SessionOptions: ") + name + " " +
                                                  std::to_string(value) + " is outside " + range};
  };
  if (result_capacity < 1 || result_capacity > kMaxResultCapacity) {
    return invalid("result_capacity", result_capacity, "1..1024");
  }
  if (deadline_ns < 0) return invalid("deadline_ns", deadline_ns, "0..");
  if (submit_timeout_ns < 0 || submit_timeout_ns > kMaxSubmitTimeoutNs) {
    return invalid("submit_timeout_ns", submit_timeout_ns, "0..1e12");
  }
  if (const Status valid = refiner.Validate(); !valid) return valid;
  return stream.Validate();
}

struct Session::Impl {
  Impl(const LineMap& line_map, const SessionOptions& session_options,
       std::unique_ptr<LineDetector> line_detector, std::unique_ptr<PoseRefiner> pose_refiner)
      : map(line_map),
        options(session_options),
        detector(std::move(line_detector)),
        refiner(std::move(pose_refiner)),
        tracker(refiner.get(), options.stream),
        segment_refiner(options.segments),
        queue(options.policy),
        results(options.result_capacity, options.policy == FramePolicy::kBlock) {}

  ~Impl() {
    queue.Close();
    results.Close();
    if (worker.joinable()) worker.join();
    if (FrameSlot* slot = queue.Leftover()) slot->ReleaseImage();
  }

  Result<SubmitOutcome> Submit(const SessionFrame& frame);
  // The part of it under the lock. @param out_release  Of the frame that was replaced.
  Result<SubmitOutcome> Enqueue(const SessionFrame& frame, int64_t now_ns,
                                ImageRelease* out_release);

  // The worker's steps.
  void Run();
  void StartDetection(FrameSlot* slot);
  void FinishDetection(FrameSlot* slot);
  void FinishFrame(FrameSlot* slot);
  Status RefineFrame(FrameSlot* slot);
  void BeginResult(const FrameTicket& ticket);
  void Publish(FrameOutcome outcome, const FrameTicket& ticket);

  const LineMap& map;
  const SessionOptions options;
  const std::unique_ptr<LineDetector> detector;
  const std::unique_ptr<PoseRefiner> refiner;
  StreamTracker tracker;
  SegmentRefiner segment_refiner;
  FrameQueue queue;
  ResultQueue results;
  std::atomic<bool> is_device_lost{false};

  std::mutex submit_mutex;  // guards the four below and the order of submissions
  ImageCamera camera;       // the last one: most streams have one
  Rectifier rectifier;      // of that, as the map corrects it
  std::optional<int64_t> last_timestamp_ns;
  uint64_t num_submitted = 0;

  mutable std::mutex stats_mutex;
  SessionStats stats;

  FrameResult result;  // of the frame that the worker is at
  std::thread worker;
};

Result<SubmitOutcome> Session::Impl::Submit(const SessionFrame& frame) {
  const int64_t now_ns = NowNs();
  if (const Status valid = ValidateFrame(frame); !valid) return valid.error();
  if (!frame.more_priors.empty() && options.refiner.method == RefineMethod::kPaper) {
    return Error{ErrorCode::kInvalidArgument,
                 "SessionFrame: more_priors has " + std::to_string(frame.more_priors.size()) +
                     " entries, the paper's method takes one prior only"};
  }
  if (is_device_lost) {
    return Error{ErrorCode::kDeviceLost, "Session: the detector's device is lost"};
  }
  ImageRelease release;
  const Result<SubmitOutcome> outcome = Enqueue(frame, now_ns, &release);
  release();  // The host may submit the next frame in there.
  return outcome;
}

Result<SubmitOutcome> Session::Impl::Enqueue(const SessionFrame& frame, int64_t now_ns,
                                             ImageRelease* out_release) {
  const std::scoped_lock submit_lock(submit_mutex);
  if (last_timestamp_ns && frame.timestamp_ns <= *last_timestamp_ns) {
    return Error{ErrorCode::kInvalidArgument,
                 "SessionFrame: timestamp_ns " + std::to_string(frame.timestamp_ns) +
                     " is not after the last frame's " + std::to_string(*last_timestamp_ns)};
  }
  if (!(camera == frame.camera)) {
    const Result<Rectifier> created = Rectifier::Create(map.Corrected(frame.camera));
    if (!created) {
      return Error{ErrorCode::kInvalidArgument, "SessionFrame: camera: " + created.error().message};
    }
    camera = frame.camera;
    rectifier = *created;
  }
  FrameSlot* slot = queue.BeginPush(options.submit_timeout_ns);
  if (slot == nullptr) return SubmitOutcome::kTimedOut;
  FrameSlot* replaced = nullptr;
  try {
    slot->Assign(frame, rectifier, now_ns);
    slot->ticket.index = num_submitted;
    const std::scoped_lock lock(stats_mutex);  // counted before it can be done
    replaced = queue.CommitPush(slot);
    ++stats.submitted;
  } catch (...) {  // Out of memory: the slot must not be lost.
    slot->release = {};
    queue.Recycle(slot);
    throw;
  }
  ++num_submitted;
  last_timestamp_ns = frame.timestamp_ns;
  if (replaced == nullptr) return SubmitOutcome::kAccepted;
  *out_release = replaced->TakeRelease();
  queue.Recycle(replaced);
  return SubmitOutcome::kReplacedFrame;
}

void Session::Impl::Run() {
  FrameSlot* in_detector = nullptr;
  for (;;) {
    if (in_detector == nullptr) {
      in_detector = queue.Pop();
      if (in_detector == nullptr) return;
      StartDetection(in_detector);
    }
    FinishDetection(in_detector);
    FrameSlot* current = std::exchange(in_detector, nullptr);
    // A detector that works in the background gets the next frame before this one is refined.
    if (detector->WorksInBackground()) {
      in_detector = queue.TryPop();
      if (in_detector != nullptr) StartDetection(in_detector);
    }
    if (!queue.IsClosed()) FinishFrame(current);
    current->ReleaseImage();
    queue.Recycle(current);
    if (queue.IsClosed()) break;
  }
  if (in_detector != nullptr) {
    FinishDetection(in_detector);
    in_detector->ReleaseImage();
    queue.Recycle(in_detector);
  }
}

void Session::Impl::StartDetection(FrameSlot* slot) {
  slot->detect_begin_ns = NowNs();
  slot->detection = Contain([&] { return detector->Submit(slot->image); });
}

void Session::Impl::FinishDetection(FrameSlot* slot) {
  const bool was_submitted = slot->detection.has_value();
  if (was_submitted) {
    slot->detection = Contain([&]() -> Status {
      Result<std::vector<Segment2>> segments = detector->Collect();
      if (!segments) return segments.error();
      slot->detected = *std::move(segments);
      return Ok();
    });
  }
  if (!slot->detection) {
    // A device that does not give a frame back would refuse all that follow. What the host's memory
    // lacks afterwards has nothing to do with it.
    const ErrorCode code = slot->detection.error().code;
    const bool is_stuck =
        was_submitted && detector->WorksInBackground() && code != ErrorCode::kOutOfMemory;
    if (is_stuck || code == ErrorCode::kDeviceLost) is_device_lost = true;
  }
  slot->detect_end_ns = NowNs();
}

void Session::Impl::FinishFrame(FrameSlot* slot) {
  for (const FrameTicket& dropped : slot->dropped_before) {
    BeginResult(dropped);
    Publish(FrameOutcome::kDropped, dropped);
  }
  const FrameTicket& ticket = slot->ticket;
  BeginResult(ticket);
  result.times.wait_ns = slot->detect_begin_ns - ticket.submitted_ns;
  result.times.detect_ns = slot->detect_end_ns - slot->detect_begin_ns;
  FrameOutcome outcome = FrameOutcome::kProcessed;
  if (!slot->detection) {
    outcome = FrameOutcome::kFailed;
    result.error = std::move(slot->detection).error();
  } else if (options.deadline_ns > 0 && NowNs() - ticket.submitted_ns > options.deadline_ns) {
    outcome = FrameOutcome::kLate;
  } else if (Status refined = Contain([&] { return RefineFrame(slot); }); !refined) {
    BeginResult(ticket);  // The refiner may have left anything in there.
    outcome = FrameOutcome::kFailed;
    result.error = std::move(refined).error();
  }
  Publish(outcome, ticket);
}

Status Session::Impl::RefineFrame(FrameSlot* slot) {
  const int64_t begin_ns = NowNs();
  segment_refiner.Refine(slot->image, slot->detected, &result.segments, &slot->rectifier);
  result.times.ridge_ns = NowNs() - begin_ns;
  slot->ReleaseImage();

  RefineInput input;
  input.camera = slot->rectifier.ideal();
  input.segments = result.segments;
  input.prior = slot->ticket.prior;
  input.more_priors = slot->more_priors;
  input.points = slot->points;
  input.seed = slot->ticket.index;
  const bool is_stream = options.mode == SessionMode::kStream;
  const Status status =
      is_stream ? tracker.Track(input, &result.refined) : refiner->Refine(input, &result.refined);
  if (!status) return status;
  result.searched = !is_stream || tracker.searched();
  result.times.search_ns = result.refined.search_ns;
  result.times.match_and_refine_ns = result.refined.match_and_refine_ns;
  return Ok();
}

// Starts a result that holds the prior, in a stream with the correction carried on.
void Session::Impl::BeginResult(const FrameTicket& ticket) {
  result.frame_index = ticket.index;
  result.timestamp_ns = ticket.timestamp_ns;
  result.user_tag = ticket.user_tag;
  result.user_kind = ticket.user_kind;
  result.prior = ticket.prior;
  result.error = {};
  result.searched = false;
  result.segments.clear();
  result.times = {};
  RefineResult& refined = result.refined;
  std::vector<LineMatch> matches = std::move(refined.matches);
  matches.clear();
  refined = {};
  refined.matches = std::move(matches);
  refined.status = RefineStatus::kKeptPrior;
  refined.cam_from_world = ticket.prior.cam_from_world;
  refined.covariance =
      PriorCovariance(ticket.prior.rotation_sigma_rad, ticket.prior.position_sigma_m);
  if (options.mode == SessionMode::kStream) {
    const auto predicted = PredictLocally(tracker.state(), options.stream, ticket.prior);
    if (predicted) refined.cam_from_world = predicted->cam_from_world;
  }
}

void Session::Impl::Publish(FrameOutcome outcome, const FrameTicket& ticket) {
  result.outcome = outcome;
  result.times.total_ns = NowNs() - ticket.submitted_ns;
  {
    const std::scoped_lock lock(stats_mutex);
    switch (outcome) {
      case FrameOutcome::kProcessed:
        ++stats.completed;
        break;
      case FrameOutcome::kDropped:
        ++stats.dropped;
        break;
      case FrameOutcome::kLate:
        ++stats.late;
        break;
      case FrameOutcome::kFailed:
        ++stats.failed;
        break;
    }
  }
  if (options.on_result) {
    options.on_result(result);
  } else {
    results.Push(&result);
  }
}

Result<std::unique_ptr<Session>> Session::Create(const MapIndex& index,
                                                 std::unique_ptr<LineDetector> detector,
                                                 const SessionOptions& options) {
  if (detector == nullptr) {
    return Error{ErrorCode::kInvalidArgument, "Session: the detector is null"};
  }
  if (const Status valid = options.Validate(); !valid) return valid.error();
  Result<std::unique_ptr<PoseRefiner>> refiner = PoseRefiner::Create(index, options.refiner);
  if (!refiner) return refiner.error();
  auto impl =
      std::make_unique<Impl>(index.map(), options, std::move(detector), *std::move(refiner));
  try {
    impl->worker = std::thread([raw = impl.get()] { raw->Run(); });
  } catch (const std::system_error& e) {
    return Error{ErrorCode::kInternal, std::string("Session: no thread: ") + e.what()};
  }
  return std::unique_ptr<Session>(new Session(std::move(impl)));
}

Session::Session(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Session::~Session() = default;

Result<SubmitOutcome> Session::Submit(const SessionFrame& frame) { return impl_->Submit(frame); }
bool Session::Poll(FrameResult* out_result) { return impl_->results.Poll(out_result); }
bool Session::Wait(int64_t timeout_ns, FrameResult* out_result) {
  return impl_->results.Wait(timeout_ns, out_result);
}

SessionStats Session::Stats() const {
  SessionStats stats;
  {
    const std::scoped_lock lock(impl_->stats_mutex);
    stats = impl_->stats;
  }
  stats.results_discarded = impl_->results.num_discarded();
  return stats;
}

}  // namespace plumb
