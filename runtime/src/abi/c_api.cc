// The plumb_* functions: the only symbols that the shared library exports.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "abi/conversion.h"
#include "abi/detector.h"
#include "abi/guard.h"
#include "abi/versioned_struct.h"
#include "plumb/base/log.h"
#include "plumb/map/line_map.h"
#include "plumb/map/map_file.h"
#include "plumb/map/map_index.h"
#include "plumb/refine/quiet_ceres.h"
#include "plumb/runtime/session.h"
#include "plumbline/plumbline.h"

using plumb::Error;
using plumb::ErrorCode;
using plumb::Result;
using plumb::Status;
using plumb::abi::CheckOutput;
using plumb::abi::Fail;
using plumb::abi::Guard;
using plumb::abi::ReadStruct;
using plumb::abi::WriteStruct;

namespace {

static_assert(PLUMB_VERSION_MAJOR == PLUMB_BUILD_VERSION_MAJOR &&
                  PLUMB_VERSION_MINOR == PLUMB_BUILD_VERSION_MINOR &&
                  PLUMB_VERSION_PATCH == PLUMB_BUILD_VERSION_PATCH,
              "the header's version is not the project's");

static_assert(static_cast<int>(plumb::LogLevel::kDebug) == PLUMB_LOG_DEBUG &&
              static_cast<int>(plumb::LogLevel::kError) == PLUMB_LOG_ERROR);

// Size of the first version of each struct. Never changes, so the oldest callers stay valid.
#define PLUMB_SIZE_THROUGH(type, member) (offsetof(type, member) + sizeof(type::member))
constexpr size_t kMapInfoSizeV1 = PLUMB_SIZE_THROUGH(plumb_map_info, detector);
constexpr size_t kOptionsSizeV1 = PLUMB_SIZE_THROUGH(plumb_session_options, on_result_user);
constexpr size_t kFrameSizeV1 = PLUMB_SIZE_THROUGH(plumb_frame, release_user);
constexpr size_t kResultSizeV1 = PLUMB_SIZE_THROUGH(plumb_frame_result, error_message);
constexpr size_t kStatsSizeV1 = PLUMB_SIZE_THROUGH(plumb_session_stats, num_results_discarded);
#undef PLUMB_SIZE_THROUGH

struct SharedMap {
  explicit SharedMap(plumb::LineMap line_map) : map(std::move(line_map)), index(map) {}
  const plumb::LineMap map;
  const plumb::MapIndex index;
};

plumb_result NullArgument(const char* name) {
  return Fail(PLUMB_ERROR_INVALID_ARGUMENT, (std::string(name) + " must not be NULL").c_str());
}

// One for each thread, so that neither polling nor submitting allocates once they have grown.
thread_local plumb::FrameResult polled_result;
thread_local plumb::abi::FrameLists submitted_lists;

}  // namespace

struct plumb_map {
  std::shared_ptr<const SharedMap> shared;
};

struct plumb_session {
  std::shared_ptr<const SharedMap> map;  // outlives `impl`
  std::unique_ptr<plumb::Session> impl;
};

extern "C" {

uint32_t plumb_version(void) { return PLUMB_VERSION; }

const char* plumb_result_string(plumb_result result) {
  switch (result) {
    case PLUMB_OK:
      return "PLUMB_OK";
    case PLUMB_NOT_READY:
      return "PLUMB_NOT_READY";
    case PLUMB_TIMEOUT:
      return "PLUMB_TIMEOUT";
    case PLUMB_FRAME_REPLACED:
      return "PLUMB_FRAME_REPLACED";
    case PLUMB_ERROR_INVALID_ARGUMENT:
      return "PLUMB_ERROR_INVALID_ARGUMENT";
    case PLUMB_ERROR_NOT_FOUND:
      return "PLUMB_ERROR_NOT_FOUND";
    case PLUMB_ERROR_CORRUPT_DATA:
      return "PLUMB_ERROR_CORRUPT_DATA";
    case PLUMB_ERROR_UNSUPPORTED:
      return "PLUMB_ERROR_UNSUPPORTED";
    case PLUMB_ERROR_IO:
      return "PLUMB_ERROR_IO";
    case PLUMB_ERROR_DEVICE_LOST:
      return "PLUMB_ERROR_DEVICE_LOST";
    case PLUMB_ERROR_OUT_OF_MEMORY:
      return "PLUMB_ERROR_OUT_OF_MEMORY";
    case PLUMB_ERROR_INTERNAL:
      return "PLUMB_ERROR_INTERNAL";
    default:
      return "PLUMB_RESULT_UNKNOWN";
  }
}

const char* plumb_status_string(int32_t status) {
  switch (status) {
    case PLUMB_STATUS_NONE:
      return "PLUMB_STATUS_NONE";
    case PLUMB_STATUS_REFINED:
      return "PLUMB_STATUS_REFINED";
    case PLUMB_STATUS_KEPT_PRIOR:
      return "PLUMB_STATUS_KEPT_PRIOR";
    case PLUMB_STATUS_AMBIGUOUS:
      return "PLUMB_STATUS_AMBIGUOUS";
    case PLUMB_STATUS_DEGENERATE:
      return "PLUMB_STATUS_DEGENERATE";
    case PLUMB_STATUS_LOW_SUPPORT:
      return "PLUMB_STATUS_LOW_SUPPORT";
    default:
      return "PLUMB_STATUS_UNKNOWN";
  }
}

const char* plumb_last_error(void) { return plumb::abi::LastError(); }

plumb_result plumb_log_set_callback(plumb_log_callback callback, void* user, int32_t min_level) {
  return Guard([&]() -> plumb_result {
    if (min_level < PLUMB_LOG_DEBUG || min_level > PLUMB_LOG_ERROR) {
      return Fail(PLUMB_ERROR_INVALID_ARGUMENT, "min_level is not a PLUMB_LOG level");
    }
    plumb::LogSink sink;
    if (callback != nullptr) {
      sink = [callback, user](plumb::LogLevel level, const char* message) {
        callback(static_cast<int32_t>(level), message, user);
      };
    }
    plumb::SetLogSink(std::move(sink), static_cast<plumb::LogLevel>(min_level));
    return PLUMB_OK;
  });
}

plumb_result plumb_map_open(const char* path, plumb_map** out_map) {
  return Guard([&]() -> plumb_result {
    if (out_map == nullptr) return NullArgument("out_map");
    *out_map = nullptr;
    if (path == nullptr) return NullArgument("path");
    Result<plumb::LineMap> map = plumb::ReadMap(path);
    if (!map) return Fail(map.error());
    auto handle = std::make_unique<plumb_map>();
    handle->shared = std::make_shared<const SharedMap>(*std::move(map));
    *out_map = handle.release();
    return PLUMB_OK;
  });
}

plumb_result plumb_map_get_info(const plumb_map* map, plumb_map_info* out_info) {
  return Guard([&]() -> plumb_result {
    if (map == nullptr) return NullArgument("map");
    if (const Status valid = CheckOutput(out_info, kMapInfoSizeV1, "plumb_map_info"); !valid) {
      return Fail(valid.error());
    }
    const plumb::LineMap& lines = map->shared->map;
    plumb_map_info info{};
    info.num_key_frames = static_cast<uint32_t>(lines.key_frames.size());
    info.num_lines = static_cast<uint32_t>(lines.lines.size());
    for (const plumb::KeyFrame& key_frame : lines.key_frames) {
      info.num_lifted_segments += static_cast<uint32_t>(key_frame.segments.size());
    }
    lines.detector.copy(info.detector, sizeof info.detector - 1);
    WriteStruct(info, out_info);
    return PLUMB_OK;
  });
}

void plumb_map_destroy(plumb_map* map) { delete map; }

plumb_result plumb_session_create(const plumb_session_options* options,
                                  plumb_session** out_session) {
  return Guard([&]() -> plumb_result {
    if (out_session == nullptr) return NullArgument("out_session");
    *out_session = nullptr;
    const Result<plumb_session_options> read =
        ReadStruct(options, kOptionsSizeV1, "plumb_session_options");
    if (!read) return Fail(read.error());
    if (read->map == nullptr) return NullArgument("options.map");
    Result<plumb::SessionOptions> session_options = plumb::abi::OptionsFromAbi(*read);
    if (!session_options) return Fail(session_options.error());
    if (const plumb_result_callback callback = read->on_result) {
      session_options->on_result = [callback,
                                    user = read->on_result_user](const plumb::FrameResult& result) {
        const plumb_frame_result converted = plumb::abi::ResultToAbi(result);
        callback(&converted, user);
      };
    }
    auto session = std::make_unique<plumb_session>();
    session->map = read->map->shared;
    const std::string& map_detector = session->map->map.detector;
    Result<std::unique_ptr<plumb::LineDetector>> detector =
        plumb::abi::CreateDetector(*read, map_detector);
    if (!detector) return Fail(detector.error());
    if ((*detector)->Name() != map_detector) {
      plumb::Log(plumb::LogLevel::kWarning, "the map was made with the detector " + map_detector +
                                                ", the session uses " + (*detector)->Name());
    }
    plumb::QuietCeres();
    Result<std::unique_ptr<plumb::Session>> impl =
        plumb::Session::Create(session->map->index, *std::move(detector), *session_options);
    if (!impl) return Fail(impl.error());
    session->impl = *std::move(impl);
    *out_session = session.release();
    return PLUMB_OK;
  });
}

void plumb_session_destroy(plumb_session* session) { delete session; }

plumb_result plumb_session_submit_frame(plumb_session* session, const plumb_frame* frame) {
  return Guard([&]() -> plumb_result {
    if (session == nullptr) return NullArgument("session");
    const Result<plumb_frame> read = ReadStruct(frame, kFrameSizeV1, "plumb_frame");
    if (!read) return Fail(read.error());
    const Result<plumb::SessionFrame> converted = plumb::abi::FrameFromAbi(*read, &submitted_lists);
    if (!converted) return Fail(converted.error());
    const Result<plumb::SubmitOutcome> outcome = session->impl->Submit(*converted);
    if (!outcome) return Fail(outcome.error());
    switch (*outcome) {
      case plumb::SubmitOutcome::kAccepted:
        return PLUMB_OK;
      case plumb::SubmitOutcome::kReplacedFrame:
        return PLUMB_FRAME_REPLACED;
      case plumb::SubmitOutcome::kTimedOut:
        return PLUMB_TIMEOUT;
    }
    return Fail(PLUMB_ERROR_INTERNAL, "unknown submit outcome");
  });
}

plumb_result plumb_session_poll_result(plumb_session* session, plumb_frame_result* out_result) {
  return Guard([&]() -> plumb_result {
    if (session == nullptr) return NullArgument("session");
    if (const Status valid = CheckOutput(out_result, kResultSizeV1, "plumb_frame_result"); !valid) {
      return Fail(valid.error());
    }
    if (!session->impl->Poll(&polled_result)) return PLUMB_NOT_READY;
    WriteStruct(plumb::abi::ResultToAbi(polled_result), out_result);
    return PLUMB_OK;
  });
}

plumb_result plumb_session_wait_result(plumb_session* session, int64_t timeout_ns,
                                       plumb_frame_result* out_result) {
  return Guard([&]() -> plumb_result {
    if (session == nullptr) return NullArgument("session");
    if (timeout_ns < 0) {
      return Fail(PLUMB_ERROR_INVALID_ARGUMENT, "timeout_ns must not be negative");
    }
    if (const Status valid = CheckOutput(out_result, kResultSizeV1, "plumb_frame_result"); !valid) {
      return Fail(valid.error());
    }
    if (!session->impl->Wait(timeout_ns, &polled_result)) return PLUMB_TIMEOUT;
    WriteStruct(plumb::abi::ResultToAbi(polled_result), out_result);
    return PLUMB_OK;
  });
}

plumb_result plumb_session_get_stats(const plumb_session* session, plumb_session_stats* out_stats) {
  return Guard([&]() -> plumb_result {
    if (session == nullptr) return NullArgument("session");
    if (const Status valid = CheckOutput(out_stats, kStatsSizeV1, "plumb_session_stats"); !valid) {
      return Fail(valid.error());
    }
    const plumb::SessionStats stats = session->impl->Stats();
    plumb_session_stats out{};
    out.num_submitted = stats.submitted;
    out.num_processed = stats.completed;
    out.num_dropped = stats.dropped;
    out.num_late = stats.late;
    out.num_failed = stats.failed;
    out.num_results_discarded = stats.results_discarded;
    WriteStruct(out, out_stats);
    return PLUMB_OK;
  });
}

}  // extern "C"
