// The command line program: parses, runs one sub-command, turns its outcome into an exit code.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>

#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// The sub-command that the command line asks for; set while it is parsed, run afterwards.
using PendingRun = std::function<Outcome()>;

/// Adds one sub-command whose options live in an `Options` struct.
/// @param bind  void(CLI::App&, Options&): declares the options.
/// @param run   Outcome(const Options&): does the work.
template <typename Options, typename Bind, typename Run>
CLI::App* AddCommand(CLI::App& parent, PendingRun& pending, const char* name,
                     const char* description, Bind bind, Run run) {
  CLI::App* const command = parent.add_subcommand(name, description);
  auto options = std::make_shared<Options>();
  bind(*command, *options);
  command->callback(
      [options, run, &pending] { pending = [options, run] { return run(*options); }; });
  return command;
}

/// Accepts finite numbers from `min` to `max`; CLI::Range() lets NaN pass.
CLI::Validator FiniteRange(double min, double max);

/// Runs the program. Nothing is thrown; errors go to stderr as one line.
/// @return an ExitCode.
int RunProgram(int argc, const char* const* argv);

}  // namespace plumb::tools
