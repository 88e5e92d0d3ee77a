// From the options --model and --device to a line detector.
#pragma once

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "plumb/features/line_detector.h"
#include "plumb/gpu/device.h"
#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// Options that every command with a detector shares.
struct DetectorOptions {
  std::string model = "nano";
  std::string device = "auto";
};

/// Declares --model and --device.
void BindDetectorOptions(CLI::App& command, DetectorOptions& options);
void BindDeviceOption(CLI::App& command, std::string& selector);

/// Opens a compute device; says so on stderr when it is a software device.
/// @return kExitNoDevice if there is none that `selector` names.
Outcome OpenDevice(const std::string& selector, std::shared_ptr<gpu::Device>* out_device);

/// Creates the detector that `options` name. Presets are looked up as
/// assets/models/NAME.safetensors and share/plumbline/models/NAME.safetensors in the folders above
/// the program.
Outcome CreateDetector(const DetectorOptions& options, std::unique_ptr<LineDetector>* out_detector);

/// What the detector runs on, for reports: the device's name, "cpu" for LSD.
std::string DeviceOf(const LineDetector& detector);

}  // namespace plumb::tools
