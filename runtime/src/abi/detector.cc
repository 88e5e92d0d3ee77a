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
#include "plumb/features/configured_detector.h"
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

constexpr uint32_t kKnownFeatures = PLUMB_VULKAN_BUFFER_DEVICE_ADDRESS | PLUMB_VULKAN_SHADER_INT64 |
                                    PLUMB_VULKAN_SHADER_FLOAT64 | PLUMB_VULKAN_SHADER_FLOAT16 |
                                    PLUMB_VULKAN_STORAGE_16BIT | PLUMB_VULKAN_STORAGE_8BIT |
                                    PLUMB_VULKAN_SCALAR_BLOCK_LAYOUT;

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
  if ((host->enabled_features & ~kKnownFeatures) != 0) {
    return Error{ErrorCode::kUnsupported, "plumb_vulkan_host.enabled_features " +
                                              std::to_string(host->enabled_features) +
                                              " has bits that this version does not know"};
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

// What is asked of any detector. A network has the score threshold and the number of segments in
// its own decoder (`vlse`); LSD has neither.
Result<DetectionOptions> DetectionFromAbi(const plumb_session_options& options, bool is_lsd,
                                          VlseDetectorOptions* vlse) {
  const auto invalid = [](const std::string& name, const std::string& value,
                          const char* range) -> Error {
    return {ErrorCode::kInvalidArgument, "options." + name + " " + value + " is outside " + range};
  };
  const auto check = [&](const char* name, double value, double high, const char* range) -> Status {
    if (value >= 0.0 && value <= high) return Ok();  // false for NaN
    return invalid(name, std::to_string(value), range);
  };
  for (const Status& status : {check("score_threshold", options.score_threshold, 1.0, "0..1"),
                               check("min_length_px", options.min_length_px, 1e5, "0..100000"),
                               check("structural_nms", options.structural_nms, 1e5, "0..100000"),
                               check("top_k", options.top_k, 4096.0, "0..4096")}) {
    if (!status) return status.error();
  }
  DetectionOptions detection;
  detection.selection.min_length_px = options.min_length_px;
  detection.selection.structural_nms = options.structural_nms;
  if (is_lsd) {
    detection.selection.min_score = options.score_threshold;
    detection.selection.max_count = options.top_k;
  } else {
    if (options.score_threshold != 0.0) {
      vlse->score_threshold = static_cast<float>(options.score_threshold);
    }
    if (options.top_k != 0) vlse->max_lines = static_cast<int>(options.top_k);
  }
  const int32_t columns = options.tile_columns, rows = options.tile_rows;
  const auto in_range = [](int32_t count) { return count >= 1 && count <= 64; };
  if (columns == PLUMB_TILES_AUTO && rows == PLUMB_TILES_AUTO) {
    detection.tiles = {0, 0};
  } else if (in_range(columns) && in_range(rows)) {
    detection.tiles = {columns, rows};
  } else if (columns != 0 || rows != 0) {
    return invalid("tile_columns and tile_rows",
                   std::to_string(columns) + " x " + std::to_string(rows),
                   "1..64 (or both 0, or both PLUMB_TILES_AUTO)");
  }
  return detection;
}

Result<std::unique_ptr<LineDetector>> CreateUnconfigured(const plumb_session_options& options,
                                                         const std::string& model,
                                                         VlseDetectorOptions vlse) {
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
  const bool is_lsd = options.model_data == nullptr && model == "lsd";
  const Result<DetectionOptions> detection = DetectionFromAbi(options, is_lsd, &vlse);
  if (!detection) return detection.error();
  Result<std::unique_ptr<LineDetector>> detector = CreateUnconfigured(options, model, vlse);
  if (!detector) return detector.error();
  return ConfigureDetector(*std::move(detector), *detection);
}

}  // namespace plumb::abi
