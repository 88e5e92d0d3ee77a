// What is known about a compute device before and after it is opened.
#pragma once

#include <cstdint>
#include <string>

namespace plumb::gpu {

enum class DeviceType { kDiscrete, kIntegrated, kVirtual, kCpu, kOther };

/// "discrete", "integrated", "virtual", "cpu" or "other".
const char* ToString(DeviceType type);

/// Optional abilities. Of a listed device: what it supports; of an open Device: what is enabled.
struct DeviceFeatures {
  bool buffer_device_address = false;
  bool shader_int64 = false;
  bool shader_float64 = false;
  bool shader_float16 = false;
  bool storage_16bit = false;  // 16-bit types in storage buffers
  bool storage_8bit = false;   // 8-bit types in storage buffers
  bool scalar_block_layout = false;
};

struct DeviceLimits {
  uint32_t max_workgroup_invocations = 0;
  uint32_t max_workgroup_size[3] = {0, 0, 0};
  uint32_t max_workgroup_count[3] = {0, 0, 0};
  uint32_t max_shared_memory_bytes = 0;
  uint32_t max_push_constant_bytes = 0;
  uint64_t max_storage_buffer_bytes = 0;
  uint64_t max_texel_buffer_elements = 0;
  uint32_t max_bindings = 0;             // storage buffers that one kernel may bind
  uint64_t buffer_offset_alignment = 1;  // of every BufferSlice that is bound, at least 64
};

struct DeviceInfo {
  uint32_t index = 0;  // order of the Vulkan loader; what the selector's INDEX means
  std::string name;
  DeviceType type = DeviceType::kOther;
  uint32_t vendor_id = 0, device_id = 0;
  uint32_t api_version = 0;  // VK_MAKE_API_VERSION encoding
  uint32_t driver_id = 0;    // VkDriverId
  uint32_t driver_version = 0;
  std::string driver_name, driver_info;  // "llvmpipe", "Mesa 22.3.6 (LLVM 15.0.6)"

  uint32_t subgroup_size = 0;
  bool subgroup_basic = false, subgroup_shuffle = false, subgroup_arithmetic = false;
  double timestamp_period_ns = 0.0;  // 0: the compute queue has no timestamps
  DeviceFeatures features;
  DeviceLimits limits;

  /// Empty if Device::Create would accept the device, otherwise the reason in a few words.
  std::string unusable_because;

  /// Runs on the CPU, lavapipe for instance: correct, but not a GPU.
  bool IsSoftware() const { return type == DeviceType::kCpu; }
  /// Mesa's lavapipe, for which nn/ has kernels of its own.
  bool IsLavapipe() const { return driver_id == 13; }
};

/// One line for people: name, type ("software device" for a CPU), driver.
std::string Describe(const DeviceInfo& info);

}  // namespace plumb::gpu
