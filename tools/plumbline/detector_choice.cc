// From the options --model and --device to a line detector.
#include "tools/plumbline/detector_choice.h"

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "plumb/features/detector_factory.h"
#include "plumb/features/vlse_detector.h"
#include "tools/plumbline/console.h"

namespace plumb::tools {
namespace {

std::vector<std::string> ModelFolders() {
  std::vector<std::string> folders;
  std::error_code code;
  std::filesystem::path place = std::filesystem::read_symlink("/proc/self/exe", code);
  while (!code && place.has_relative_path()) {
    place = place.parent_path();
    for (const char* folder : {"assets/models", "share/plumbline/models"}) {
      if (std::filesystem::is_directory(place / folder, code)) {
        folders.push_back((place / folder).string());
      }
      code.clear();
    }
  }
  return folders;
}

}  // namespace

void BindDeviceOption(CLI::App& command, std::string& selector) {
  command
      .add_option("--device", selector,
                  "Compute device: auto, cpu, its index or a part of its name")
      ->capture_default_str();
}

void BindDetectorOptions(CLI::App& command, DetectorOptions& options) {
  command
      .add_option("--model", options.model,
                  "Line detector: a network's preset, the path of its .safetensors, or lsd")
      ->capture_default_str();
  BindDeviceOption(command, options.device);
}

Outcome OpenDevice(const std::string& selector, std::shared_ptr<gpu::Device>* out_device) {
  gpu::DeviceOptions options;
  options.selector = selector;
  Result<std::shared_ptr<gpu::Device>> device = gpu::Device::Create(options);
  if (!device) {
    const ErrorCode code = device.error().code;
    return Failure{code == ErrorCode::kInvalidArgument ? kExitUsage : kExitNoDevice,
                   "--device " + selector + ": " + device.error().message};
  }
  *out_device = *std::move(device);
  const gpu::DeviceInfo& info = (*out_device)->Info();
  if (info.IsSoftware()) PrintRemark("device: " + gpu::Describe(info));
  return std::nullopt;
}

Outcome CreateDetector(const DetectorOptions& options,
                       std::unique_ptr<LineDetector>* out_detector) {
  VlseDetectorOptions vlse;
  if (options.model != "lsd") {
    if (Outcome failed = OpenDevice(options.device, &vlse.device)) return failed;
  }
  Result<std::unique_ptr<LineDetector>> detector =
      CreateLineDetector(options.model, vlse, ModelFolders());
  if (!detector) return FailureFrom(detector.error());
  *out_detector = *std::move(detector);
  return std::nullopt;
}

std::string DeviceOf(const LineDetector& detector) {
  const auto* network = dynamic_cast<const VlseDetector*>(&detector);
  return network != nullptr ? network->GetDeviceInfo().name : "cpu";
}

}  // namespace plumb::tools
