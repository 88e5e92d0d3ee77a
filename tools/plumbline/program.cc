// The command line program: parses, runs one sub-command, turns its outcome into an exit code.
#include "tools/plumbline/program.h"

#include <cstdio>
#include <exception>
#include <vector>

#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

constexpr const char* kFooter =
    "Exit codes: 0 ok, 64 usage, 65 bad data, 66 input missing, 69 no usable device,\n"
    "70 internal error, 73 output cannot be created, 74 I/O error, 75 device lost,\n130 or 143 "
    "interrupted.\n"
    "Data goes to stdout (with --json one JSON document alone), remarks to stderr.";

/// A command that only groups others.
CLI::App& AddGroup(CLI::App& parent, const char* name, const char* description) {
  CLI::App* const group = parent.add_subcommand(name, description);
  group->require_subcommand(1);
  return *group;
}

void AddCommands(CLI::App& program, PendingRun& pending) {
  AddDetect(program, pending);
  CLI::App& map = AddGroup(program, "map", "Build, inspect and export line maps");
  AddMapBuild(map, pending);
  AddMapInfo(map, pending);
  AddMapExport(map, pending);
  AddReplay(program, pending);
  CLI::App& eval = AddGroup(program, "eval", "Score detections or refined poses");
  AddEvalAblation(eval, pending);
  AddEvalControls(eval, pending);
  AddEvalLines(eval, pending);
  AddEvalRepeatability(eval, pending);
  AddEvalTrajectory(eval, pending);
  CLI::App& bench = AddGroup(program, "bench", "Measure speed");
  AddBenchNet(bench, pending);
  AddBenchFrame(bench, pending);
  AddBenchRefine(bench, pending);
  AddSynth(program, pending);
  CLI::App& device = AddGroup(program, "device", "Compute devices");
  AddDeviceList(device, pending);
  AddVersion(program, pending);
}

/// Says which word names no command; empty if that is not what is wrong.
std::string UnknownCommand(const CLI::App& program) {
  const CLI::App* app = &program;
  std::string path;
  while (!app->get_subcommands().empty()) {
    app = app->get_subcommands().front();
    path += app->get_name() + ": ";
  }
  const std::vector<std::string> words = program.remaining(true);
  if (app->get_require_subcommand_min() == 0 || words.empty() || words.front().starts_with('-')) {
    return "";
  }
  return path + "no command '" + words.front() + "'";
}

int Fail(const Failure& failure) {
  PrintRemark(failure.message);
  return failure.code;
}

}  // namespace

CLI::Validator FiniteRange(double min, double max) {
  char range[80];
  std::snprintf(range, sizeof(range), "in [%.6g - %.6g]", min, max);
  const std::string text = range;
  return CLI::Validator(
      [min, max, text](std::string& input) {
        double value = 0.0;
        const bool is_good =
            CLI::detail::lexical_cast(input, value) && value >= min && value <= max;
        return is_good ? std::string() : "Value " + input + " is not " + text;
      },
      "FLOAT " + text);
}

int RunProgram(int argc, const char* const* argv) {
  PendingRun pending;
  CLI::App program("Refines camera poses with 3D line maps.", "plumbline");
  program.require_subcommand(1);
  program.footer(kFooter);
  program.set_version_flag("--version", PLUMB_VERSION);
  try {
    AddCommands(program, pending);
    program.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    // --help and --version arrive as "errors" with code 0.
    if (e.get_exit_code() == 0) return program.exit(e) == 0 ? kExitOk : kExitUsage;
    const std::string unknown = UnknownCommand(program);
    return Fail({kExitUsage, (unknown.empty() ? e.what() : unknown) + " (try --help)"});
  }
  NoteInterrupts();
  try {
    const Outcome failed = pending();
    return failed ? Fail(*failed) : static_cast<int>(kExitOk);
  } catch (const std::exception& e) {
    return Fail({kExitInternal, std::string("internal error: ") + e.what()});
  }
}

}  // namespace plumb::tools
