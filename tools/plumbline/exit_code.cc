// Exit codes of the program, and failures that carry one.
#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

ExitCode ExitCodeOf(ErrorCode code) {
  if (code == ErrorCode::kInvalidArgument) return kExitUsage;
  if (code == ErrorCode::kNotFound) return kExitNoInput;
  // Data of another version or model than this build reads; detectors map it to kExitNoDevice.
  if (code == ErrorCode::kCorruptData || code == ErrorCode::kUnsupported) return kExitBadData;
  if (code == ErrorCode::kIoError) return kExitIo;
  if (code == ErrorCode::kDeviceLost) return kExitTryAgain;
  return kExitInternal;
}

Failure FailureFrom(const Error& error) { return {ExitCodeOf(error.code), error.message}; }

Failure FailureToWrite(const Error& error) {
  return {error.code == ErrorCode::kIoError ? kExitIo : kExitCannotCreate, error.message};
}

}  // namespace plumb::tools
