// Runs the built program as a user does.
#pragma once

#include <cstdlib>
#include <string>

#include <sys/wait.h>

#include "tests/tools/temporary_directory.h"

namespace plumb::testing {

struct ProgramRun {
  int exit_code = -1;  // -1: killed by a signal
  std::string out, err;
};

/// `arguments` as typed in a shell; paths must not need quoting.
/// @param runner  A command that runs the program, "timeout 1".
inline ProgramRun RunPlumbline(const std::string& arguments, const std::string& runner = "") {
  const TemporaryDirectory streams;
  const std::string command = runner + " " + PLUMBLINE_PROGRAM + " " + arguments + " >" +
                              (streams / "out") + " 2>" + (streams / "err") + " </dev/null";
  const int status = std::system(command.c_str());
  ProgramRun run;
  if (WIFEXITED(status)) run.exit_code = WEXITSTATUS(status);
  run.out = ReadAll(streams / "out");
  run.err = ReadAll(streams / "err");
  return run;
}

}  // namespace plumb::testing
