// Exit codes of the program, and failures that carry one.
#pragma once

#include <optional>
#include <string>

#include "plumb/base/result.h"

namespace plumb::tools {

/// The codes of sysexits.h where they fit; README.md lists them.
enum ExitCode : int {
  kExitOk = 0,
  kExitUsage = 64,         // an option or argument is wrong
  kExitBadData = 65,       // an input is corrupt or inconsistent
  kExitNoInput = 66,       // an input is missing
  kExitNoDevice = 69,      // no usable device, or a device lacks what is needed
  kExitInternal = 70,      // a bug in this program
  kExitCannotCreate = 73,  // an output cannot be created
  kExitIo = 74,            // reading or writing failed half-way
  kExitTryAgain = 75,      // the device was lost
  kExitInterrupted = 130,  // SIGINT
  kExitTerminated = 143,   // SIGTERM
};

/// Why a command stopped: one sentence that names the object and the value.
struct Failure {
  ExitCode code = kExitInternal;
  std::string message;
};

/// nullopt: all went well.
using Outcome = std::optional<Failure>;

/// The exit code that fits a library's error.
ExitCode ExitCodeOf(ErrorCode code);
Failure FailureFrom(const Error& error);
/// The same of an output: what the system refused to write is kExitIo, all else kExitCannotCreate.
Failure FailureToWrite(const Error& error);

}  // namespace plumb::tools
