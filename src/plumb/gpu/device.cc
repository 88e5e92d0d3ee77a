#include "plumb/gpu/device.h"

#include <string>
#include <utility>

#include "plumb/gpu/vulkan_api.h"

namespace plumb::gpu {
namespace {

Result<std::vector<VkPhysicalDevice>> PhysicalDevices(const Instance& instance) {
  uint32_t count = 0;
  PLUMB_VK_RETURN("vkEnumeratePhysicalDevices",
                  instance.table.vkEnumeratePhysicalDevices(instance.handle, &count, nullptr));
  std::vector<VkPhysicalDevice> handles(count);
  const VkResult result =
      instance.table.vkEnumeratePhysicalDevices(instance.handle, &count, handles.data());
  if (result != VK_SUCCESS && result != VK_INCOMPLETE) {
    return VulkanError("vkEnumeratePhysicalDevices", result);
  }
  handles.resize(count);
  return handles;
}

std::vector<DeviceInfo> QueryDeviceInfos(const Instance& instance,
                                         const std::vector<VkPhysicalDevice>& handles) {
  std::vector<DeviceInfo> infos;
  for (size_t i = 0; i < handles.size(); ++i) {
    infos.push_back(QueryDeviceInfo(instance.table, handles[i]));
    infos.back().index = static_cast<uint32_t>(i);
  }
  return infos;
}

// Creates the logical device with every feature of `vulkan->info` enabled.
Status CreateLogicalDevice(VulkanDevice* vulkan) {
  const auto flag = [](bool on) -> VkBool32 { return on ? VK_TRUE : VK_FALSE; };
  const DeviceFeatures& features = vulkan->info.features;
  auto v12 = MakeInfo<VkPhysicalDeviceVulkan12Features>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
  v12.bufferDeviceAddress = flag(features.buffer_device_address);
  v12.shaderFloat16 = flag(features.shader_float16);
  v12.storageBuffer8BitAccess = flag(features.storage_8bit);
  v12.scalarBlockLayout = flag(features.scalar_block_layout);
  auto v11 = MakeInfo<VkPhysicalDeviceVulkan11Features>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES);
  v11.pNext = &v12;
  v11.storageBuffer16BitAccess = flag(features.storage_16bit);
  auto core = MakeInfo<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  core.pNext = &v11;
  core.features.shaderInt64 = flag(features.shader_int64);
  core.features.shaderFloat64 = flag(features.shader_float64);

  const float priority = 1.0f;
  auto queue = MakeInfo<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue.queueFamilyIndex = vulkan->queue_family;
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;
  auto info = MakeInfo<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  info.pNext = &core;
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue;
  PLUMB_VK_RETURN("vkCreateDevice", vulkan->instance->table.vkCreateDevice(
                                        vulkan->physical_device, &info, nullptr, &vulkan->handle));
  vulkan->is_owned = true;
  vulkan->table = LoadDeviceTable(vulkan->instance->table, vulkan->handle);
  vulkan->table.vkGetDeviceQueue(vulkan->handle, vulkan->queue_family, 0, &vulkan->queue);
  return Ok();
}

const char* FirstMissing(const HostDevice& host) {
  if (host.get_instance_proc_addr == nullptr) return "get_instance_proc_addr";
  if (host.instance == nullptr) return "instance";
  if (host.physical_device == nullptr) return "physical_device";
  if (host.device == nullptr) return "device";
  if (host.queue == nullptr) return "queue";
  if (host.lock_queue != nullptr && host.unlock_queue == nullptr) return "unlock_queue";
  if (host.unlock_queue != nullptr && host.lock_queue == nullptr) return "lock_queue";
  return nullptr;
}

}  // namespace

Device::Device(std::unique_ptr<VulkanDevice> vulkan) : vulkan_(std::move(vulkan)) {}

Device::~Device() {
  if (!vulkan_->is_owned) return;
  vulkan_->table.vkDeviceWaitIdle(vulkan_->handle);
  vulkan_->table.vkDestroyDevice(vulkan_->handle, nullptr);
}

Result<std::shared_ptr<Device>> Device::Create(const DeviceOptions& options) {
  Result<std::unique_ptr<Instance>> instance = Instance::Create(options.validation);
  if (!instance) return instance.error();
  Result<std::vector<VkPhysicalDevice>> handles = PhysicalDevices(**instance);
  if (!handles) return handles.error();
  const std::vector<DeviceInfo> infos = QueryDeviceInfos(**instance, *handles);
  const Result<size_t> selected = SelectDevice(infos, options.selector);
  if (!selected) return selected.error();

  auto vulkan = std::make_unique<VulkanDevice>();
  vulkan->instance = std::move(*instance);
  vulkan->physical_device = (*handles)[*selected];
  vulkan->info = infos[*selected];
  vulkan->queue_family =
      static_cast<uint32_t>(FindComputeFamily(vulkan->instance->table, vulkan->physical_device));
  vulkan->instance->table.vkGetPhysicalDeviceMemoryProperties(vulkan->physical_device,
                                                              &vulkan->memory);
  if (const Status created = CreateLogicalDevice(vulkan.get()); !created) return created.error();
  if (options.log) options.log("device: " + Describe(vulkan->info));
  return std::shared_ptr<Device>(new Device(std::move(vulkan)));
}

Result<std::shared_ptr<Device>> Device::Adopt(const HostDevice& host) {
  if (const char* missing = FirstMissing(host); missing != nullptr) {
    return Error{ErrorCode::kInvalidArgument, std::string("HostDevice: ") + missing + " is null"};
  }
  Result<std::unique_ptr<Instance>> instance =
      Instance::Adopt(reinterpret_cast<PFN_vkGetInstanceProcAddr>(host.get_instance_proc_addr),
                      static_cast<VkInstance>(host.instance), host.listen_to_validation);
  if (!instance) return instance.error();

  auto vulkan = std::make_unique<VulkanDevice>();
  vulkan->instance = std::move(*instance);
  vulkan->physical_device = static_cast<VkPhysicalDevice>(host.physical_device);
  vulkan->info = QueryDeviceInfo(vulkan->instance->table, vulkan->physical_device);
  if (!vulkan->info.unusable_because.empty()) {
    return Error{ErrorCode::kUnsupported, "HostDevice: " + vulkan->info.name +
                                              " cannot be used: " + vulkan->info.unusable_because};
  }
  vulkan->info.features = host.enabled_features;
  vulkan->handle = static_cast<VkDevice>(host.device);
  vulkan->queue = static_cast<VkQueue>(host.queue);
  vulkan->queue_family = host.queue_family;
  if (!IsComputeFamily(vulkan->instance->table, vulkan->physical_device, host.queue_family)) {
    return Error{ErrorCode::kInvalidArgument, "HostDevice: queue_family " +
                                                  std::to_string(host.queue_family) + " of " +
                                                  vulkan->info.name + " cannot compute"};
  }
  vulkan->lock_queue = host.lock_queue;
  vulkan->unlock_queue = host.unlock_queue;
  vulkan->user = host.user;
  vulkan->instance->table.vkGetPhysicalDeviceMemoryProperties(vulkan->physical_device,
                                                              &vulkan->memory);
  vulkan->table = LoadDeviceTable(vulkan->instance->table, vulkan->handle);
  return std::shared_ptr<Device>(new Device(std::move(vulkan)));
}

const DeviceInfo& Device::Info() const { return vulkan_->info; }

std::vector<std::string> Device::ValidationMessages() const {
  return vulkan_->instance->validation_log.Messages();
}

size_t Device::NumValidationMessages() const {
  return vulkan_->instance->validation_log.NumMessages();
}

void Device::ClearValidationMessages() { vulkan_->instance->validation_log.Clear(); }

Result<std::vector<DeviceInfo>> ListDevices() {
  Result<std::unique_ptr<Instance>> instance = Instance::Create(false);
  if (!instance) return instance.error();
  Result<std::vector<VkPhysicalDevice>> handles = PhysicalDevices(**instance);
  if (!handles) return handles.error();
  return QueryDeviceInfos(**instance, *handles);
}

}  // namespace plumb::gpu
