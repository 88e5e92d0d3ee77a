#include "abi/detector.h"

#include <dlfcn.h>

#include <cstddef>
#include <filesystem>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "abi/versioned_struct.h"
#include "plumb/base/log.h"
#include "plumb/features/detector_factory.h"
#include "plumb/features/vlse_detector.h"
#include "plumb/gpu/device.h"

namespace plumb::abi {
namespace {

// Where the weights of the built-in networks lie: beside the installed library, or in the source
// tree around the build tree.
std::vector<std::string> ModelFolders() {
  std::vector<std::string> folders;
  Dl_info library{};
  if (dladdr(reinterpret_cast<const void*>(&plumb_version), &library) == 0) return folders;
  std::error_code code;
  std::filesystem::path place = std::filesystem::canonical(library.dli_fname, code);
  while (!code && place.has_relative_path()) {
    place = place.parent_path();
    for (const char* folder : {"share/plumbline/models", "assets/models"}) {
      std::error_code missing;
      if (std::filesystem::is_directory(place / folder, missing)) {
        folders.push_back((place / folder).string());
      }
    }
  }
  return folders;
}

Result<std::shared_ptr<gpu::Device>> AdoptDevice(const plumb_vulkan_host& from) {
  constexpr size_t kSizeV1 = offsetof(plumb_vulkan_host, reserved) + sizeof from.reserved;
  Result<plumb_vulkan_host> host = ReadStruct(&from, kSizeV1, "plumb_vulkan_host");
  if (!host) return host.error();
  if (host->reserved != 0) {
    return Error{ErrorCode::kInvalidArgument, "plumb_vulkan_host.reserved is not zero"};
  }
  if ((host->lock_queue == nullptr) != (host->unlock_queue == nullptr)) {
    return Error{ErrorCode::kInvalidArgument,
                 "plumb_vulkan_host.lock_queue and unlock_queue need each other"};
  }
  const auto has = [&](uint32_t bit) { return (host->enabled_features & bit) != 0; };
  gpu::HostDevice device;
  device.get_instance_proc_addr = reinterpret_cast<void*>(host->get_instance_proc_addr);
  device.instance = host->instance;
  device.physical_device = host->physical_device;
  device.device = host->device;
  device.queue = host->queue;
  device.queue_family = host->queue_family;
  device.lock_queue = host->lock_queue;
  device.unlock_queue = host->unlock_queue;
  device.user = host->user;
  device.enabled_features.buffer_device_address = has(PLUMB_VULKAN_BUFFER_DEVICE_ADDRESS);
  device.enabled_features.shader_int64 = has(PLUMB_VULKAN_SHADER_INT64);
  device.enabled_features.shader_float64 = has(PLUMB_VULKAN_SHADER_FLOAT64);
  device.enabled_features.shader_float16 = has(PLUMB_VULKAN_SHADER_FLOAT16);
  device.enabled_features.storage_16bit = has(PLUMB_VULKAN_STORAGE_16BIT);
  device.enabled_features.storage_8bit = has(PLUMB_VULKAN_STORAGE_8BIT);
  device.enabled_features.scalar_block_layout = has(PLUMB_VULKAN_SCALAR_BLOCK_LAYOUT);
  return gpu::Device::Adopt(device);
}

Result<std::shared_ptr<gpu::Device>> OpenDevice(const plumb_session_options& options) {
  if (options.vulkan_host != nullptr) return AdoptDevice(*options.vulkan_host);
  gpu::DeviceOptions device_options;
  if (options.device != nullptr) device_options.selector = options.device;
  device_options.log = [](const std::string& message) { Log(LogLevel::kInfo, message); };
  return gpu::Device::Create(device_options);
}

}  // namespace

Result<std::unique_ptr<LineDetector>> CreateDetector(const plumb_session_options& options,
                                                     const std::string& map_detector) {
  if (options.model != nullptr && options.model_data != nullptr) {
    return Error{ErrorCode::kInvalidArgument,
                 "options.model and options.model_data exclude each other"};
  }
  if ((options.model_data == nullptr) != (options.model_size_bytes == 0)) {
    return Error{ErrorCode::kInvalidArgument,
                 "options.model_data and options.model_size_bytes contradict each other"};
  }
  if (options.device != nullptr && options.vulkan_host != nullptr) {
    return Error{ErrorCode::kInvalidArgument,
                 "options.device and options.vulkan_host exclude each other"};
  }
  const std::string model = options.model != nullptr ? options.model : map_detector;
  VlseDetectorOptions vlse;
  if (options.model_data == nullptr && model == "lsd") return CreateLineDetector(model, vlse);

  Result<std::shared_ptr<gpu::Device>> device = OpenDevice(options);
  if (!device) return device.error();
  Log((*device)->Info().IsSoftware() ? LogLevel::kWarning : LogLevel::kInfo,
      "device: " + gpu::Describe((*device)->Info()));
  vlse.device = *std::move(device);
  if (options.model_data == nullptr) return CreateLineDetector(model, vlse, ModelFolders());
  vlse.model_data = std::span(static_cast<const std::byte*>(options.model_data),
                              static_cast<size_t>(options.model_size_bytes));
  Result<std::unique_ptr<VlseDetector>> detector = VlseDetector::Create(vlse);
  if (!detector) return detector.error();
  return std::unique_ptr<LineDetector>(*std::move(detector));
}

}  // namespace plumb::abi
