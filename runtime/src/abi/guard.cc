#include "abi/guard.h"

namespace plumb::abi {
namespace {

// Fixed storage: to report that memory is out must not need any.
constexpr size_t kMaxErrorBytes = 512;
thread_local char last_error[kMaxErrorBytes] = "";

}  // namespace

const char* LastError() noexcept { return last_error; }

plumb_result Fail(plumb_result result, const char* message) noexcept {
  size_t i = 0;
  for (; i + 1 < kMaxErrorBytes && message[i] != '\0'; ++i) last_error[i] = message[i];
  last_error[i] = '\0';
  return result;
}

plumb_result Fail(const Error& error) noexcept {
  return Fail(ToAbi(error.code), error.message.c_str());
}

plumb_result ToAbi(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return PLUMB_ERROR_INVALID_ARGUMENT;
    case ErrorCode::kNotFound:
      return PLUMB_ERROR_NOT_FOUND;
    case ErrorCode::kCorruptData:
      return PLUMB_ERROR_CORRUPT_DATA;
    case ErrorCode::kUnsupported:
      return PLUMB_ERROR_UNSUPPORTED;
    case ErrorCode::kIoError:
      return PLUMB_ERROR_IO;
    case ErrorCode::kDeviceLost:
      return PLUMB_ERROR_DEVICE_LOST;
    case ErrorCode::kOutOfMemory:
      return PLUMB_ERROR_OUT_OF_MEMORY;
    case ErrorCode::kInternal:
      return PLUMB_ERROR_INTERNAL;
  }
  return PLUMB_ERROR_INTERNAL;
}

}  // namespace plumb::abi
