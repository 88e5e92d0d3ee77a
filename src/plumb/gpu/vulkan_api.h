// Vulkan's entry points for gpu/*.cc: the loader is opened at run time, nothing is linked.
#pragma once

#include <volk.h>

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/gpu/device.h"

namespace plumb::gpu {

/// kDeviceLost for VK_ERROR_DEVICE_LOST, kUnsupported for exhausted memory, else kInternal; the
/// message is "<call>: VK_ERROR_...".
Error VulkanError(const char* call, VkResult result);

/// Returns from the calling function when a Vulkan call fails.
#define PLUMB_VK_RETURN(call_name, call)                                    \
  do {                                                                      \
    if (const VkResult plumb_result = (call); plumb_result != VK_SUCCESS) { \
      return ::plumb::gpu::VulkanError(call_name, plumb_result);            \
    }                                                                       \
  } while (false)

/// A Vulkan structure with its type set and all other members zero.
template <typename T>
T MakeInfo(VkStructureType type) {
  T info{};
  info.sType = type;
  return info;
}

/// Entry points that belong to an instance. They are kept per instance, not in volk's globals, so
/// that a host's loader and ours can live side by side.
struct InstanceTable {
  PFN_vkDestroyInstance vkDestroyInstance = nullptr;
  PFN_vkEnumeratePhysicalDevices vkEnumeratePhysicalDevices = nullptr;
  PFN_vkGetPhysicalDeviceProperties2 vkGetPhysicalDeviceProperties2 = nullptr;
  PFN_vkGetPhysicalDeviceProperties vkGetPhysicalDeviceProperties = nullptr;
  PFN_vkGetPhysicalDeviceFeatures2 vkGetPhysicalDeviceFeatures2 = nullptr;
  PFN_vkGetPhysicalDeviceMemoryProperties vkGetPhysicalDeviceMemoryProperties = nullptr;
  PFN_vkGetPhysicalDeviceQueueFamilyProperties vkGetPhysicalDeviceQueueFamilyProperties = nullptr;
  PFN_vkCreateDevice vkCreateDevice = nullptr;
  PFN_vkGetDeviceProcAddr vkGetDeviceProcAddr = nullptr;
  // With VK_EXT_debug_utils only.
  PFN_vkCreateDebugUtilsMessengerEXT vkCreateDebugUtilsMessengerEXT = nullptr;
  PFN_vkDestroyDebugUtilsMessengerEXT vkDestroyDebugUtilsMessengerEXT = nullptr;
  PFN_vkSetDebugUtilsObjectNameEXT vkSetDebugUtilsObjectNameEXT = nullptr;
};

/// Opens libvulkan once per process. kUnsupported if there is none.
Result<PFN_vkGetInstanceProcAddr> OpenVulkanLoader();

/// Loads the functions of `device`.
VolkDeviceTable LoadDeviceTable(const InstanceTable& instance_table, VkDevice device);

/// What the validation layer said. Thread-safe: drivers and layers call from any thread.
class ValidationLog {
 public:
  void Add(const char* message);
  std::vector<std::string> Messages() const;
  size_t NumMessages() const;
  void Clear();

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> messages_;
  size_t num_messages_ = 0;
};

/// An instance and, with validation, a messenger that fills `validation_log`.
struct Instance {
  Instance() = default;
  ~Instance();
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;

  static Result<std::unique_ptr<Instance>> Create(bool validation);
  static Result<std::unique_ptr<Instance>> Adopt(PFN_vkGetInstanceProcAddr get_proc_addr,
                                                 VkInstance handle, bool listen_to_validation);

  InstanceTable table;
  VkInstance handle = VK_NULL_HANDLE;
  bool is_owned = false;
  VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
  ValidationLog validation_log;
};

/// Properties of a physical device; `index` is left 0.
DeviceInfo QueryDeviceInfo(const InstanceTable& table, VkPhysicalDevice physical_device);

/// A family with compute, preferably without graphics; -1 if there is none.
int FindComputeFamily(const InstanceTable& table, VkPhysicalDevice physical_device);
bool IsComputeFamily(const InstanceTable& table, VkPhysicalDevice physical_device, uint32_t family);

struct VulkanDevice {
  std::unique_ptr<Instance> instance;
  VkPhysicalDevice physical_device = VK_NULL_HANDLE;
  VkDevice handle = VK_NULL_HANDLE;
  bool is_owned = false;
  VkQueue queue = VK_NULL_HANDLE;
  uint32_t queue_family = 0;
  VolkDeviceTable table{};
  VkPhysicalDeviceMemoryProperties memory{};
  DeviceInfo info;  // with `features` reduced to what is enabled

  mutable std::mutex queue_mutex;  // own queue; a host's queue is locked by its callbacks
  void (*lock_queue)(void* user) = nullptr;
  void (*unlock_queue)(void* user) = nullptr;
  void* user = nullptr;

  VkResult Submit(const VkSubmitInfo& submit, VkFence fence) const;
  /// For debuggers and validation messages.
  void SetName(VkObjectType type, uint64_t object, const std::string& name) const;
};

/// Non-dispatchable handles are pointers on 64-bit systems, integers elsewhere.
template <typename Handle>
uint64_t HandleBits(Handle handle) {
  return reinterpret_cast<uint64_t>(handle);
}

}  // namespace plumb::gpu
