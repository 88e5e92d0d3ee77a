// The network behind the C interface: weights by name and from memory, a device of its own and the
// host's.
#include <volk.h>

#include <cstring>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/map/map_file.h"
#include "plumbline/plumbline.h"
#include "support/temporary_directory.h"
#include "support/wall_scene.h"

namespace plumb {
namespace {

constexpr int64_t kMinuteNs = 60'000'000'000;
constexpr char kWeights[] = "assets/models/nano.safetensors";  // from the source directory

Rigid3 TruePose() { return {ExpSo3({0.01, 0.2, -0.01}), Eigen::Vector3d(0.03, 0.0, -0.02)}; }

// What the Vulkan objects of a host program are; gone with it.
struct Host {
  VkInstance instance = VK_NULL_HANDLE;
  VkPhysicalDevice physical_device = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  VkQueue queue = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT debug_messenger = VK_NULL_HANDLE;
  std::vector<std::string> messages;
  uint32_t family = 0, features = 0;
  int num_locked = 0, num_unlocked = 0;

  ~Host() {
    if (device != VK_NULL_HANDLE) {
      reinterpret_cast<PFN_vkDestroyDevice>(vkGetInstanceProcAddr(instance, "vkDestroyDevice"))(
          device, nullptr);
    }
    if (debug_messenger != VK_NULL_HANDLE) {
      vkDestroyDebugUtilsMessengerEXT(instance, debug_messenger, nullptr);
    }
    if (instance != VK_NULL_HANDLE) vkDestroyInstance(instance, nullptr);
  }

  static VKAPI_ATTR VkBool32 VKAPI_CALL
  AppendMessage(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
    static_cast<Host*>(user)->messages.emplace_back(data->pMessage);
    return VK_FALSE;
  }

  // False where there is no device to compute on.
  bool Open() {
    VkApplicationInfo application{};
    application.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
    application.apiVersion = VK_API_VERSION_1_2;
    VkInstanceCreateInfo instance_info{};
    instance_info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    instance_info.pApplicationInfo = &application;
    // The host's own validation sees what the library does with its device.
    VkDebugUtilsMessengerCreateInfoEXT messenger{};
    messenger.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
    messenger.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT |
                                VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    messenger.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    messenger.pfnUserCallback = &AppendMessage;
    messenger.pUserData = this;
    const char* layer = "VK_LAYER_KHRONOS_validation";
    const char* extension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
    instance_info.enabledLayerCount = 1;
    instance_info.ppEnabledLayerNames = &layer;
    instance_info.enabledExtensionCount = 1;
    instance_info.ppEnabledExtensionNames = &extension;
    if (vkCreateInstance(&instance_info, nullptr, &instance) != VK_SUCCESS) return false;
    volkLoadInstance(instance);
    if (vkCreateDebugUtilsMessengerEXT(instance, &messenger, nullptr, &debug_messenger) !=
        VK_SUCCESS) {
      return false;
    }
    uint32_t count = 1;
    if (vkEnumeratePhysicalDevices(instance, &count, &physical_device) < 0 || count == 0) {
      return false;
    }
    uint32_t num_families = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(physical_device, &num_families, nullptr);
    std::vector<VkQueueFamilyProperties> families(num_families);
    vkGetPhysicalDeviceQueueFamilyProperties(physical_device, &num_families, families.data());
    while (family < num_families && (families[family].queueFlags & VK_QUEUE_COMPUTE_BIT) == 0) {
      ++family;
    }
    if (family == num_families) return false;
    const float priority = 1.0f;
    VkDeviceQueueCreateInfo queue_info{};
    queue_info.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
    queue_info.queueFamilyIndex = family;
    queue_info.queueCount = 1;
    queue_info.pQueuePriorities = &priority;
    // Without these the network runs on the kernels for any device, slowly on a CPU.
    VkPhysicalDeviceVulkan12Features supported12{}, enabled12{};
    supported12.sType = enabled12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    VkPhysicalDeviceFeatures2 supported{}, enabled{};
    supported.sType = enabled.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
    supported.pNext = &supported12;
    enabled.pNext = &enabled12;
    vkGetPhysicalDeviceFeatures2(physical_device, &supported);
    const auto enable = [this](VkBool32 is_supported, VkBool32* feature, uint32_t bit) {
      *feature = is_supported;
      if (is_supported == VK_TRUE) features |= bit;
    };
    enable(supported12.bufferDeviceAddress, &enabled12.bufferDeviceAddress,
           PLUMB_VULKAN_BUFFER_DEVICE_ADDRESS);
    enable(supported12.scalarBlockLayout, &enabled12.scalarBlockLayout,
           PLUMB_VULKAN_SCALAR_BLOCK_LAYOUT);
    enable(supported.features.shaderInt64, &enabled.features.shaderInt64,
           PLUMB_VULKAN_SHADER_INT64);
    enable(supported.features.shaderFloat64, &enabled.features.shaderFloat64,
           PLUMB_VULKAN_SHADER_FLOAT64);
    VkDeviceCreateInfo device_info{};
    device_info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
    device_info.pNext = &enabled;
    device_info.queueCreateInfoCount = 1;
    device_info.pQueueCreateInfos = &queue_info;
    if (vkCreateDevice(physical_device, &device_info, nullptr, &device) != VK_SUCCESS) return false;
    reinterpret_cast<PFN_vkGetDeviceQueue>(vkGetInstanceProcAddr(instance, "vkGetDeviceQueue"))(
        device, family, 0, &queue);
    return true;
  }

  plumb_vulkan_host Handles() {
    plumb_vulkan_host handles{};
    handles.struct_size = sizeof handles;
    handles.queue_family = family;
    // One signature in Vulkan's words and in the interface's.
    handles.get_instance_proc_addr =
        reinterpret_cast<plumb_vk_get_instance_proc_addr>(vkGetInstanceProcAddr);
    handles.instance = instance;
    handles.physical_device = physical_device;
    handles.device = device;
    handles.queue = queue;
    handles.lock_queue = [](void* user) { ++static_cast<Host*>(user)->num_locked; };
    handles.unlock_queue = [](void* user) { ++static_cast<Host*>(user)->num_unlocked; };
    handles.user = this;
    handles.enabled_features = features;
    return handles;
  }
};

class NetworkTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (volkInitialize() != VK_SUCCESS) GTEST_SKIP() << "no Vulkan loader";
    Host host;
    if (!host.Open()) GTEST_SKIP() << "no Vulkan device";
    ASSERT_TRUE(WriteMap(scene_.MakeMap(testing::WallScene::KeyFramePoses()), folder_ / "map"));
    ASSERT_EQ(plumb_map_open((folder_ / "map").c_str(), &map_), PLUMB_OK) << plumb_last_error();
    options_.struct_size = sizeof options_;
    options_.map = map_;
  }
  void TearDown() override { plumb_map_destroy(map_); }

  // Opens a session with `options_`, sends one frame through, closes it.
  void ExpectLinesFound() { EXPECT_GT(CountSegments(), 10u); }

  // The number of segments that such a session finds in a frame.
  uint32_t CountSegments() {
    plumb_session* session = nullptr;
    EXPECT_EQ(plumb_session_create(&options_, &session), PLUMB_OK) << plumb_last_error();
    if (session == nullptr) return 0;
    const testing::GrayImage image = scene_.Render(TruePose());
    plumb_frame frame{};
    frame.struct_size = sizeof frame;
    frame.format = PLUMB_FORMAT_GRAY8;
    frame.width_px = static_cast<uint32_t>(image.width_px);
    frame.height_px = static_cast<uint32_t>(image.height_px);
    frame.planes[0] = image.pixels.data();
    frame.row_stride_bytes[0] = image.width_px;
    frame.fx = scene_.camera.fx;
    frame.fy = scene_.camera.fy;
    frame.cx = scene_.camera.cx;
    frame.cy = scene_.camera.cy;
    frame.pose_convention = PLUMB_POSE_CV_CAM_FROM_WORLD;
    const Rigid3 pose = TruePose();
    std::memcpy(frame.prior_q_xyzw, pose.rotation.coeffs().data(), sizeof frame.prior_q_xyzw);
    std::memcpy(frame.prior_t_m, pose.translation.data(), sizeof frame.prior_t_m);
    EXPECT_EQ(plumb_session_submit_frame(session, &frame), PLUMB_OK) << plumb_last_error();
    plumb_frame_result result{};
    result.struct_size = sizeof result;
    EXPECT_EQ(plumb_session_wait_result(session, kMinuteNs, &result), PLUMB_OK);
    EXPECT_EQ(result.outcome, PLUMB_OUTCOME_PROCESSED) << result.error_message;
    plumb_session_destroy(session);
    return result.num_segments;
  }
  void ExpectRefused(plumb_result code, const std::string& part) {
    plumb_session* session = nullptr;
    EXPECT_EQ(plumb_session_create(&options_, &session), code) << plumb_last_error();
    EXPECT_EQ(session, nullptr);
    EXPECT_NE(std::string(plumb_last_error()).find(part), std::string::npos) << plumb_last_error();
  }

  const testing::WallScene scene_;
  const testing::TemporaryDirectory folder_;
  plumb_map* map_ = nullptr;
  plumb_session_options options_{};
};

TEST_F(NetworkTest, BuiltInNetworkIsFoundByItsName) {
  options_.model = "nano";
  ExpectLinesFound();
}

TEST_F(NetworkTest, DetectionOptionsReachTheNetworkAndTheEdges) {
  options_.model = "nano";
  const uint32_t usual = CountSegments();
  options_.edge_flags = PLUMB_EDGE_KEEP_DUPLICATES;
  EXPECT_GT(CountSegments(), usual);
  options_.edge_flags = PLUMB_EDGE_ONE_BORDER;
  options_.top_k = 5;
  EXPECT_LE(CountSegments(), 5u);
  options_.top_k = 0;
  options_.score_threshold = 1.0;
  EXPECT_LT(CountSegments(), usual);
}

TEST_F(NetworkTest, WeightsMayComeFromMemoryAndRunOnTheHostsDevice) {
  std::string weights = testing::Slurp(kWeights);
  ASSERT_GT(weights.size(), 1000u);
  Host host;
  ASSERT_TRUE(host.Open());
  const plumb_vulkan_host handles = host.Handles();
  options_.model_data = weights.data();
  options_.model_size_bytes = weights.size();
  options_.vulkan_host = &handles;
  ExpectLinesFound();
  EXPECT_GT(host.num_locked, 0);
  EXPECT_EQ(host.num_locked, host.num_unlocked);
  for (const std::string& message : host.messages) ADD_FAILURE() << message;
}

TEST_F(NetworkTest, TruncatedWeightsAreRefused) {
  const std::string weights = testing::Slurp(kWeights).substr(0, 5000);
  options_.model_data = weights.data();
  options_.model_size_bytes = weights.size();
  ExpectRefused(PLUMB_ERROR_CORRUPT_DATA, "");
}

TEST_F(NetworkTest, UnknownModelAndDeviceAreNamed) {
  options_.model = "no-such-model";
  ExpectRefused(PLUMB_ERROR_NOT_FOUND, "no-such-model");
  options_.model = "nano";
  options_.device = "no-such-device";
  ExpectRefused(PLUMB_ERROR_NOT_FOUND, "no-such-device");
}

TEST_F(NetworkTest, IncompleteHostIsRefused) {
  Host host;
  ASSERT_TRUE(host.Open());
  plumb_vulkan_host handles = host.Handles();
  options_.model = "nano";
  options_.vulkan_host = &handles;
  handles.queue = nullptr;
  ExpectRefused(PLUMB_ERROR_INVALID_ARGUMENT, "queue");
  handles = host.Handles();
  handles.unlock_queue = nullptr;
  ExpectRefused(PLUMB_ERROR_INVALID_ARGUMENT, "unlock_queue");
  handles = host.Handles();
  handles.struct_size = 3;
  ExpectRefused(PLUMB_ERROR_INVALID_ARGUMENT, "struct_size 3");
  handles = host.Handles();
  handles.queue_family = 99;
  ExpectRefused(PLUMB_ERROR_INVALID_ARGUMENT, "queue_family 99");
  handles = host.Handles();
  handles.enabled_features |= 1u << 30;
  ExpectRefused(PLUMB_ERROR_UNSUPPORTED, "enabled_features");
  handles = host.Handles();
  options_.device = "cpu";
  ExpectRefused(PLUMB_ERROR_INVALID_ARGUMENT, "exclude each other");
}

}  // namespace
}  // namespace plumb
