#include "plumb/gpu/vulkan_api.h"

#include <utility>

namespace plumb::gpu {
namespace {

constexpr size_t kMaxKeptMessages = 100;

// Guards what volk keeps in globals: the loader's handle and vkGetDeviceProcAddr.
std::mutex& VolkMutex() {
  static std::mutex mutex;
  return mutex;
}

const char* ResultName(VkResult result) {
  switch (result) {
    case VK_NOT_READY:
      return "VK_NOT_READY";
    case VK_TIMEOUT:
      return "VK_TIMEOUT";
    case VK_INCOMPLETE:
      return "VK_INCOMPLETE";
    case VK_ERROR_OUT_OF_HOST_MEMORY:
      return "VK_ERROR_OUT_OF_HOST_MEMORY";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
      return "VK_ERROR_OUT_OF_DEVICE_MEMORY";
    case VK_ERROR_INITIALIZATION_FAILED:
      return "VK_ERROR_INITIALIZATION_FAILED";
    case VK_ERROR_DEVICE_LOST:
      return "VK_ERROR_DEVICE_LOST";
    case VK_ERROR_MEMORY_MAP_FAILED:
      return "VK_ERROR_MEMORY_MAP_FAILED";
    case VK_ERROR_LAYER_NOT_PRESENT:
      return "VK_ERROR_LAYER_NOT_PRESENT";
    case VK_ERROR_EXTENSION_NOT_PRESENT:
      return "VK_ERROR_EXTENSION_NOT_PRESENT";
    case VK_ERROR_FEATURE_NOT_PRESENT:
      return "VK_ERROR_FEATURE_NOT_PRESENT";
    case VK_ERROR_INCOMPATIBLE_DRIVER:
      return "VK_ERROR_INCOMPATIBLE_DRIVER";
    case VK_ERROR_TOO_MANY_OBJECTS:
      return "VK_ERROR_TOO_MANY_OBJECTS";
    case VK_ERROR_OUT_OF_POOL_MEMORY:
      return "VK_ERROR_OUT_OF_POOL_MEMORY";
    case VK_ERROR_FRAGMENTED_POOL:
      return "VK_ERROR_FRAGMENTED_POOL";
    case VK_ERROR_UNKNOWN:
      return "VK_ERROR_UNKNOWN";
    default:
      return nullptr;
  }
}

ErrorCode CodeOf(VkResult result) {
  switch (result) {
    case VK_ERROR_DEVICE_LOST:
      return ErrorCode::kDeviceLost;
    case VK_ERROR_OUT_OF_HOST_MEMORY:
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
    case VK_ERROR_LAYER_NOT_PRESENT:
    case VK_ERROR_EXTENSION_NOT_PRESENT:
    case VK_ERROR_FEATURE_NOT_PRESENT:
    case VK_ERROR_INCOMPATIBLE_DRIVER:
      return ErrorCode::kUnsupported;
    default:
      return ErrorCode::kInternal;
  }
}

}  // namespace

Error VulkanError(const char* call, VkResult result) {
  const char* name = ResultName(result);
  const std::string text = name != nullptr ? name : "VkResult " + std::to_string(result);
  return Error{CodeOf(result), std::string(call) + ": " + text};
}

Result<PFN_vkGetInstanceProcAddr> OpenVulkanLoader() {
  const std::lock_guard lock(VolkMutex());
  if (vkGetInstanceProcAddr == nullptr && volkInitialize() != VK_SUCCESS) {
    return Error{ErrorCode::kUnsupported, "no Vulkan loader: libvulkan.so.1 could not be opened"};
  }
  return vkGetInstanceProcAddr;
}

VolkDeviceTable LoadDeviceTable(const InstanceTable& instance_table, VkDevice device) {
  const std::lock_guard lock(VolkMutex());
  vkGetDeviceProcAddr = instance_table.vkGetDeviceProcAddr;  // What volkLoadDeviceTable() asks.
  VolkDeviceTable table{};
  volkLoadDeviceTable(&table, device);
  return table;
}

void ValidationLog::Add(const char* message) {
  const std::lock_guard lock(mutex_);
  ++num_messages_;
  if (messages_.size() < kMaxKeptMessages) messages_.emplace_back(message);
}

std::vector<std::string> ValidationLog::Messages() const {
  const std::lock_guard lock(mutex_);
  return messages_;
}

size_t ValidationLog::NumMessages() const {
  const std::lock_guard lock(mutex_);
  return num_messages_;
}

void ValidationLog::Clear() {
  const std::lock_guard lock(mutex_);
  messages_.clear();
  num_messages_ = 0;
}

VkResult VulkanDevice::Submit(const VkSubmitInfo& submit, VkFence fence) const {
  if (lock_queue != nullptr) {
    lock_queue(user);
    const VkResult result = table.vkQueueSubmit(queue, 1, &submit, fence);
    unlock_queue(user);
    return result;
  }
  const std::lock_guard lock(queue_mutex);
  return table.vkQueueSubmit(queue, 1, &submit, fence);
}

void VulkanDevice::SetName(VkObjectType type, uint64_t object, const std::string& name) const {
  if (instance->table.vkSetDebugUtilsObjectNameEXT == nullptr) return;
  auto name_info =
      MakeInfo<VkDebugUtilsObjectNameInfoEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT);
  name_info.objectType = type;
  name_info.objectHandle = object;
  name_info.pObjectName = name.c_str();
  instance->table.vkSetDebugUtilsObjectNameEXT(handle, &name_info);
}

}  // namespace plumb::gpu
