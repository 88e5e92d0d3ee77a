// A Vulkan compute device and its queue, opened by the library or lent by the host program.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/gpu/device_info.h"

namespace plumb::gpu {

struct VulkanDevice;  // Handles and entry points; complete in gpu/*.cc only.

struct DeviceOptions {
  /// "auto" (discrete, integrated, virtual, then CPU), "cpu", an index, or a part of the name.
  std::string selector = "auto";
  /// Turns the Khronos validation layer with synchronization validation on; see
  /// Device::ValidationMessages(). kUnsupported from Create() where the layer is not installed.
  bool validation = false;
  /// Called with one line per remark, on the thread that caused it. May be empty.
  std::function<void(const std::string&)> log = {};
};

/// A device that the host program owns. All handles are Vulkan's, passed through as pointers; they
/// must outlive the Device. Vulkan 1.2 is needed, and the queue must support compute.
struct HostDevice {
  void* get_instance_proc_addr = nullptr;  // PFN_vkGetInstanceProcAddr
  void* instance = nullptr;                // VkInstance
  void* physical_device = nullptr;         // VkPhysicalDevice
  void* device = nullptr;                  // VkDevice
  void* queue = nullptr;                   // VkQueue
  uint32_t queue_family = 0;
  DeviceFeatures enabled_features;  // what the host enabled when it created the device
  /// Called around every use of the queue; both null if no other thread uses the queue.
  void (*lock_queue)(void* user) = nullptr;
  void (*unlock_queue)(void* user) = nullptr;
  void* user = nullptr;
  /// Attach a messenger to the host's instance, which must have VK_EXT_debug_utils enabled.
  bool listen_to_validation = false;
};

/// Thread-safe. Buffers, kernels and command lists keep their device alive.
class Device {
 public:
  /// @return kInvalidArgument for an empty selector, kNotFound when no device matches (the message
  /// names the selector and the devices), kUnsupported without Vulkan loader, layer or Vulkan 1.2.
  static Result<std::shared_ptr<Device>> Create(const DeviceOptions& options);

  /// Uses the host's device; destroys nothing of it.
  /// @return kInvalidArgument that names the first missing handle.
  static Result<std::shared_ptr<Device>> Adopt(const HostDevice& host);

  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  const DeviceInfo& Info() const;

  /// Warnings and errors of the validation layer since the device was opened, oldest first; at most
  /// 100 are kept. Empty without validation.
  std::vector<std::string> ValidationMessages() const;
  size_t NumValidationMessages() const;
  /// Forgets the messages; for tests that provoke one.
  void ClearValidationMessages();

  const VulkanDevice& Vulkan() const { return *vulkan_; }

 private:
  explicit Device(std::unique_ptr<VulkanDevice> vulkan);
  std::unique_ptr<VulkanDevice> vulkan_;
};

/// All devices that the Vulkan loader knows, unusable ones included. Empty list if it has none;
/// kUnsupported if there is no loader.
Result<std::vector<DeviceInfo>> ListDevices();

/// The position in `devices` that `selector` picks (see DeviceOptions); usable devices only.
Result<size_t> SelectDevice(const std::vector<DeviceInfo>& devices, const std::string& selector);

}  // namespace plumb::gpu
