// plumbline version: what this build is.
#include <string>

#include "tools/plumbline/commands.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

struct VersionOptions {
  bool json = false;
};

Outcome RunVersion(const VersionOptions& options) {
  if (!options.json) return PrintText(std::string("plumbline ") + PLUMB_VERSION + "\n");
  Json report = NewReport("version");
  report["compiler"] = __VERSION__;
  return PrintJson(report);
}

}  // namespace

void AddVersion(CLI::App& program, PendingRun& pending) {
  AddCommand<VersionOptions>(
      program, pending, "version", "Print the version",
      [](CLI::App& command, VersionOptions& options) {
        command.add_flag("--json", options.json, "Print JSON");
      },
      RunVersion);
}

}  // namespace plumb::tools
