// From the option --model to a line detector.
#pragma once

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "plumb/features/line_detector.h"
#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// Options that every command with a detector shares.
struct DetectorOptions {
  std::string model = "nano";
};

/// Declares --model.
void BindDetectorOptions(CLI::App& command, DetectorOptions& options);

/// Creates the detector that `options` name.
Outcome CreateDetector(const DetectorOptions& options, std::unique_ptr<LineDetector>* out_detector);

}  // namespace plumb::tools
