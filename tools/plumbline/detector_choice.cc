// From the option --model to a line detector.
#include "tools/plumbline/detector_choice.h"

#include "plumb/features/lsd_detector.h"

namespace plumb::tools {

void BindDetectorOptions(CLI::App& command, DetectorOptions& options) {
  command
      .add_option("--model", options.model,
                  "Line detector: a network's preset, the path of its .safetensors, or lsd")
      ->capture_default_str();
}

Outcome CreateDetector(const DetectorOptions& options,
                       std::unique_ptr<LineDetector>* out_detector) {
  if (options.model == "lsd") {
    *out_detector = CreateLsdDetector();
    return std::nullopt;
  }
  return Failure{kExitNoInput,
                 "--model " + options.model + ": no such model in this build (have: lsd)"};
}

}  // namespace plumb::tools
