// Creation of the instance, with the validation layer on request.
#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "plumb/gpu/vulkan_api.h"

namespace plumb::gpu {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

VKAPI_ATTR VkBool32 VKAPI_CALL OnMessage(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                         VkDebugUtilsMessageTypeFlagsEXT,
                                         const VkDebugUtilsMessengerCallbackDataEXT* data,
                                         void* user) {
  static_cast<ValidationLog*>(user)->Add(data->pMessage);
  return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT MessengerInfo(ValidationLog* log) {
  auto info = MakeInfo<VkDebugUtilsMessengerCreateInfoEXT>(
      VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT);
  info.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT |
                         VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  // Without the "general" type: the loader reports unusable drivers of the machine there.
  info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
  info.pfnUserCallback = OnMessage;
  info.pUserData = log;
  return info;
}

InstanceTable LoadInstanceTable(PFN_vkGetInstanceProcAddr get, VkInstance instance) {
  InstanceTable table;
  const auto load = [&](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(get(instance, name));
  };
#define PLUMB_LOAD(name) load(table.name, #name)
  PLUMB_LOAD(vkDestroyInstance);
  PLUMB_LOAD(vkEnumeratePhysicalDevices);
  PLUMB_LOAD(vkGetPhysicalDeviceProperties);
  PLUMB_LOAD(vkGetPhysicalDeviceProperties2);
  PLUMB_LOAD(vkGetPhysicalDeviceFeatures2);
  PLUMB_LOAD(vkGetPhysicalDeviceMemoryProperties);
  PLUMB_LOAD(vkGetPhysicalDeviceQueueFamilyProperties);
  PLUMB_LOAD(vkCreateDevice);
  PLUMB_LOAD(vkGetDeviceProcAddr);
  PLUMB_LOAD(vkCreateDebugUtilsMessengerEXT);
  PLUMB_LOAD(vkDestroyDebugUtilsMessengerEXT);
  PLUMB_LOAD(vkSetDebugUtilsObjectNameEXT);
#undef PLUMB_LOAD
  return table;
}

bool HasValidationLayer(PFN_vkGetInstanceProcAddr get) {
  const auto enumerate = reinterpret_cast<PFN_vkEnumerateInstanceLayerProperties>(
      get(nullptr, "vkEnumerateInstanceLayerProperties"));
  uint32_t count = 0;
  if (enumerate == nullptr || enumerate(&count, nullptr) != VK_SUCCESS) return false;
  std::vector<VkLayerProperties> layers(count);
  if (enumerate(&count, layers.data()) < 0) return false;
  layers.resize(count);
  return std::any_of(layers.begin(), layers.end(), [](const VkLayerProperties& layer) {
    return std::strcmp(layer.layerName, kValidationLayer) == 0;
  });
}

Status StartMessenger(Instance* instance) {
  if (instance->table.vkCreateDebugUtilsMessengerEXT == nullptr) {
    return Error{ErrorCode::kUnsupported,
                 "validation messages need VK_EXT_debug_utils, which the instance has not enabled"};
  }
  const VkDebugUtilsMessengerCreateInfoEXT info = MessengerInfo(&instance->validation_log);
  PLUMB_VK_RETURN("vkCreateDebugUtilsMessengerEXT",
                  instance->table.vkCreateDebugUtilsMessengerEXT(instance->handle, &info, nullptr,
                                                                 &instance->messenger));
  return Ok();
}

}  // namespace

Instance::~Instance() {
  if (messenger != VK_NULL_HANDLE) {
    table.vkDestroyDebugUtilsMessengerEXT(handle, messenger, nullptr);
  }
  if (is_owned && handle != VK_NULL_HANDLE) table.vkDestroyInstance(handle, nullptr);
}

Result<std::unique_ptr<Instance>> Instance::Create(bool validation) {
  Result<PFN_vkGetInstanceProcAddr> get = OpenVulkanLoader();
  if (!get) return get.error();
  if (validation && !HasValidationLayer(*get)) {
    return Error{ErrorCode::kUnsupported, std::string("validation was asked for, but the layer ") +
                                              kValidationLayer + " is not installed"};
  }
  const auto create = reinterpret_cast<PFN_vkCreateInstance>((*get)(nullptr, "vkCreateInstance"));
  if (create == nullptr) {
    return Error{ErrorCode::kUnsupported, "the Vulkan loader has no vkCreateInstance"};
  }

  auto instance = std::make_unique<Instance>();
  auto application = MakeInfo<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.pApplicationName = "plumbline";
  application.apiVersion = VK_API_VERSION_1_2;
  auto info = MakeInfo<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  info.pApplicationInfo = &application;

  const char* const extensions[] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME};
  VkDebugUtilsMessengerCreateInfoEXT messenger = MessengerInfo(&instance->validation_log);
  const VkValidationFeatureEnableEXT checks[] = {
      VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
  auto features = MakeInfo<VkValidationFeaturesEXT>(VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT);
#ifdef VK_EXT_layer_settings
  // Newer layers (Debian 13) look at what shaders access only when told to.
  const VkBool32 on = VK_TRUE;
  const VkLayerSettingEXT setting{kValidationLayer, "syncval_shader_accesses_heuristic",
                                  VK_LAYER_SETTING_TYPE_BOOL32_EXT, 1, &on};
  auto settings =
      MakeInfo<VkLayerSettingsCreateInfoEXT>(VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT);
  settings.settingCount = 1;
  settings.pSettings = &setting;
  messenger.pNext = &settings;
#endif
  if (validation) {
    features.enabledValidationFeatureCount = 1;
    features.pEnabledValidationFeatures = checks;
    features.pNext = &messenger;  // Also hears the creation and destruction of the instance.
    info.pNext = &features;
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &kValidationLayer;
    info.enabledExtensionCount = 1;
    info.ppEnabledExtensionNames = extensions;
  }
  PLUMB_VK_RETURN("vkCreateInstance", create(&info, nullptr, &instance->handle));
  instance->is_owned = true;
  instance->table = LoadInstanceTable(*get, instance->handle);
  if (validation) {
    if (const Status started = StartMessenger(instance.get()); !started) return started.error();
  }
  return instance;
}

Result<std::unique_ptr<Instance>> Instance::Adopt(PFN_vkGetInstanceProcAddr get_proc_addr,
                                                  VkInstance handle, bool listen_to_validation) {
  auto instance = std::make_unique<Instance>();
  instance->handle = handle;
  instance->table = LoadInstanceTable(get_proc_addr, handle);
  if (instance->table.vkGetDeviceProcAddr == nullptr ||
      instance->table.vkGetPhysicalDeviceProperties2 == nullptr) {
    return Error{ErrorCode::kInvalidArgument,
                 "HostDevice: get_instance_proc_addr does not know Vulkan 1.1's functions"};
  }
  if (listen_to_validation) {
    if (const Status started = StartMessenger(instance.get()); !started) return started.error();
  }
  return instance;
}

}  // namespace plumb::gpu
