#include "plumb/gpu/device_info.h"

#include <algorithm>

#include "plumb/gpu/vulkan_api.h"

namespace plumb::gpu {
namespace {

// Enough for every binding kind on the devices we know, and for whole cache lines.
constexpr uint64_t kMinOffsetAlignment = 64;

DeviceType TypeOf(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return DeviceType::kDiscrete;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return DeviceType::kIntegrated;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return DeviceType::kVirtual;
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
      return DeviceType::kCpu;
    default:
      return DeviceType::kOther;
  }
}

DeviceLimits LimitsOf(const VkPhysicalDeviceLimits& limits) {
  DeviceLimits out;
  out.max_workgroup_invocations = limits.maxComputeWorkGroupInvocations;
  std::copy_n(limits.maxComputeWorkGroupSize, 3, out.max_workgroup_size);
  std::copy_n(limits.maxComputeWorkGroupCount, 3, out.max_workgroup_count);
  out.max_shared_memory_bytes = limits.maxComputeSharedMemorySize;
  out.max_push_constant_bytes = limits.maxPushConstantsSize;
  out.max_storage_buffer_bytes = limits.maxStorageBufferRange;
  out.max_texel_buffer_elements = limits.maxTexelBufferElements;
  out.max_bindings = limits.maxPerStageDescriptorStorageBuffers;
  out.buffer_offset_alignment =
      std::max({kMinOffsetAlignment, limits.minStorageBufferOffsetAlignment,
                limits.minTexelBufferOffsetAlignment, limits.optimalBufferCopyOffsetAlignment});
  return out;
}

// Of a device of Vulkan 1.2 or later.
DeviceFeatures QueryFeatures(const InstanceTable& table, VkPhysicalDevice physical_device) {
  auto v12 = MakeInfo<VkPhysicalDeviceVulkan12Features>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
  auto v11 = MakeInfo<VkPhysicalDeviceVulkan11Features>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES);
  v11.pNext = &v12;
  auto core = MakeInfo<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  core.pNext = &v11;
  table.vkGetPhysicalDeviceFeatures2(physical_device, &core);
  DeviceFeatures out;
  out.buffer_device_address = v12.bufferDeviceAddress == VK_TRUE;
  out.shader_int64 = core.features.shaderInt64 == VK_TRUE;
  out.shader_float64 = core.features.shaderFloat64 == VK_TRUE;
  out.shader_float16 = v12.shaderFloat16 == VK_TRUE;
  out.storage_16bit = v11.storageBuffer16BitAccess == VK_TRUE;
  out.storage_8bit = v12.storageBuffer8BitAccess == VK_TRUE;
  out.scalar_block_layout = v12.scalarBlockLayout == VK_TRUE;
  return out;
}

std::string VersionText(uint32_t version) {
  std::string text = std::to_string(VK_API_VERSION_MAJOR(version));
  text.append(".").append(std::to_string(VK_API_VERSION_MINOR(version)));
  return text;
}

std::vector<VkQueueFamilyProperties> QueueFamilies(const InstanceTable& table,
                                                   VkPhysicalDevice physical_device) {
  uint32_t count = 0;
  table.vkGetPhysicalDeviceQueueFamilyProperties(physical_device, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  table.vkGetPhysicalDeviceQueueFamilyProperties(physical_device, &count, families.data());
  return families;
}

bool CanCompute(const VkQueueFamilyProperties& family) {
  return family.queueCount > 0 && (family.queueFlags & VK_QUEUE_COMPUTE_BIT) != 0;
}

}  // namespace

const char* ToString(DeviceType type) {
  switch (type) {
    case DeviceType::kDiscrete:
      return "discrete";
    case DeviceType::kIntegrated:
      return "integrated";
    case DeviceType::kVirtual:
      return "virtual";
    case DeviceType::kCpu:
      return "cpu";
    case DeviceType::kOther:
      return "other";
  }
  return "other";
}

std::string Describe(const DeviceInfo& info) {
  std::string text = info.name;
  text.append(" (").append(info.IsSoftware() ? "software device" : ToString(info.type));
  text.append(", ").append(info.driver_name).append(", ").append(info.driver_info).append(")");
  return text;
}

int FindComputeFamily(const InstanceTable& table, VkPhysicalDevice physical_device) {
  const auto families = QueueFamilies(table, physical_device);
  int best = -1;
  for (size_t i = 0; i < families.size(); ++i) {
    if (!CanCompute(families[i])) continue;
    // A family without graphics keeps clear of the host's rendering.
    if ((families[i].queueFlags & VK_QUEUE_GRAPHICS_BIT) == 0) return static_cast<int>(i);
    if (best < 0) best = static_cast<int>(i);
  }
  return best;
}

bool IsComputeFamily(const InstanceTable& table, VkPhysicalDevice physical_device,
                     uint32_t family) {
  const auto families = QueueFamilies(table, physical_device);
  return family < families.size() && CanCompute(families[family]);
}

DeviceInfo QueryDeviceInfo(const InstanceTable& table, VkPhysicalDevice physical_device) {
  DeviceInfo info;
  VkPhysicalDeviceProperties core{};
  table.vkGetPhysicalDeviceProperties(physical_device, &core);
  info.name = core.deviceName;
  info.type = TypeOf(core.deviceType);
  info.vendor_id = core.vendorID;
  info.device_id = core.deviceID;
  info.api_version = core.apiVersion;
  info.driver_version = core.driverVersion;
  info.limits = LimitsOf(core.limits);
  if (core.apiVersion < VK_API_VERSION_1_2) {
    info.unusable_because = VersionText(core.apiVersion) + " is less than Vulkan 1.2";
    return info;
  }

  auto driver = MakeInfo<VkPhysicalDeviceDriverProperties>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES);
  auto subgroup = MakeInfo<VkPhysicalDeviceSubgroupProperties>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES);
  subgroup.pNext = &driver;
  auto properties =
      MakeInfo<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  properties.pNext = &subgroup;
  table.vkGetPhysicalDeviceProperties2(physical_device, &properties);
  info.driver_id = static_cast<uint32_t>(driver.driverID);
  info.driver_name = driver.driverName;
  info.driver_info = driver.driverInfo;
  info.subgroup_size = subgroup.subgroupSize;
  if ((subgroup.supportedStages & VK_SHADER_STAGE_COMPUTE_BIT) != 0) {
    const VkSubgroupFeatureFlags operations = subgroup.supportedOperations;
    info.subgroup_basic = (operations & VK_SUBGROUP_FEATURE_BASIC_BIT) != 0;
    info.subgroup_shuffle = (operations & VK_SUBGROUP_FEATURE_SHUFFLE_BIT) != 0;
    info.subgroup_arithmetic = (operations & VK_SUBGROUP_FEATURE_ARITHMETIC_BIT) != 0;
  }
  info.features = QueryFeatures(table, physical_device);

  const int family = FindComputeFamily(table, physical_device);
  if (family < 0) {
    info.unusable_because = "it has no compute queue";
    return info;
  }
  const auto families = QueueFamilies(table, physical_device);
  if (families[static_cast<size_t>(family)].timestampValidBits > 0) {
    info.timestamp_period_ns = static_cast<double>(core.limits.timestampPeriod);
  }
  return info;
}

}  // namespace plumb::gpu
