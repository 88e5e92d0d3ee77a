// A device that the host program owns: the test plays the host.
#include <gmock/gmock.h>
#include <volk.h>

#include <array>

#include "plumb/gpu/kernel.h"
#include "plumb/gpu/recorder.h"
#include "shaders/registry.h"
#include "support/gpu_fixture.h"

namespace plumb::gpu {
namespace {

using ::testing::HasSubstr;

class HostDeviceTest : public plumb::testing::GpuTest {
 protected:
  void SetUp() override {
    GpuTest::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    ASSERT_EQ(volkInitialize(), VK_SUCCESS);
    VkApplicationInfo application{};
    application.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
    application.apiVersion = VK_API_VERSION_1_2;
    const char* layer = "VK_LAYER_KHRONOS_validation";
    const char* extension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
    VkInstanceCreateInfo instance_info{};
    instance_info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    instance_info.pApplicationInfo = &application;
    instance_info.enabledLayerCount = 1;
    instance_info.ppEnabledLayerNames = &layer;
    instance_info.enabledExtensionCount = 1;
    instance_info.ppEnabledExtensionNames = &extension;
    ASSERT_EQ(vkCreateInstance(&instance_info, nullptr, &instance_), VK_SUCCESS);
    volkLoadInstance(instance_);

    uint32_t count = 1;
    ASSERT_GE(vkEnumeratePhysicalDevices(instance_, &count, &physical_device_), VK_SUCCESS);
    uint32_t num_families = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(physical_device_, &num_families, nullptr);
    std::vector<VkQueueFamilyProperties> families(num_families);
    vkGetPhysicalDeviceQueueFamilyProperties(physical_device_, &num_families, families.data());
    while (family_ < num_families && (families[family_].queueFlags & VK_QUEUE_COMPUTE_BIT) == 0) {
      ++family_;
    }
    ASSERT_LT(family_, num_families);
    const float priority = 1.0f;
    VkDeviceQueueCreateInfo queue_info{};
    queue_info.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
    queue_info.queueFamilyIndex = family_;
    queue_info.queueCount = 1;
    queue_info.pQueuePriorities = &priority;
    VkDeviceCreateInfo device_info{};
    device_info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
    device_info.queueCreateInfoCount = 1;
    device_info.pQueueCreateInfos = &queue_info;
    ASSERT_EQ(vkCreateDevice(physical_device_, &device_info, nullptr, &host_device_), VK_SUCCESS);
    destroy_device_ =
        reinterpret_cast<PFN_vkDestroyDevice>(vkGetInstanceProcAddr(instance_, "vkDestroyDevice"));
    const auto get_queue = reinterpret_cast<PFN_vkGetDeviceQueue>(
        vkGetInstanceProcAddr(instance_, "vkGetDeviceQueue"));
    get_queue(host_device_, family_, 0, &queue_);
  }

  void TearDown() override {
    if (host_device_ != VK_NULL_HANDLE) destroy_device_(host_device_, nullptr);
    if (instance_ != VK_NULL_HANDLE) vkDestroyInstance(instance_, nullptr);
    GpuTest::TearDown();
  }

  HostDevice Host() {
    HostDevice host;
    host.get_instance_proc_addr = reinterpret_cast<void*>(vkGetInstanceProcAddr);
    host.instance = instance_;
    host.physical_device = physical_device_;
    host.device = host_device_;
    host.queue = queue_;
    host.queue_family = family_;
    host.listen_to_validation = true;
    return host;
  }

  VkInstance instance_ = VK_NULL_HANDLE;
  VkPhysicalDevice physical_device_ = VK_NULL_HANDLE;
  VkDevice host_device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  uint32_t family_ = 0;
  PFN_vkDestroyDevice destroy_device_ = nullptr;
};

struct QueueLock {
  int locked = 0, unlocked = 0;
};

TEST_F(HostDeviceTest, RunsAKernelAndLocksTheQueueAroundEverySubmission) {
  QueueLock lock;
  HostDevice host = Host();
  host.user = &lock;
  host.lock_queue = [](void* user) { ++static_cast<QueueLock*>(user)->locked; };
  host.unlock_queue = [](void* user) { ++static_cast<QueueLock*>(user)->unlocked; };
  Result<std::shared_ptr<Device>> device = Device::Adopt(host);
  PLUMB_ASSERT_OK(device);
  EXPECT_FALSE((*device)->Info().features.buffer_device_address);  // The host enabled nothing.

  Result<std::unique_ptr<Kernel>> copy =
      Kernel::Create(*device, {.name = "texel_copy",
                               .spirv = shaders::Find("test/texel_copy"),
                               .bindings = {{0, BindingKind::kTexelRgba32F, Access::kRead},
                                            {1, BindingKind::kStorage, Access::kWrite}},
                               .push_constant_bytes = 4});
  PLUMB_ASSERT_OK(copy);
  auto in = Buffer::Create(*device, {"in", 32, MemoryUse::kUpload});
  auto out = Buffer::Create(*device, {"out", 32, MemoryUse::kReadback});
  PLUMB_ASSERT_OK(in);
  PLUMB_ASSERT_OK(out);
  EXPECT_EQ((*in)->Address(), 0u);
  const std::array<float, 8> values = {1, 2, 3, 4, 5, 6, 7, 8};
  std::memcpy((*in)->Data(), values.data(), sizeof(values));

  auto recorder = Recorder::Create(*device, {.name = "host"});
  PLUMB_ASSERT_OK(recorder);
  struct Push {
    uint32_t n;
  };
  (*recorder)->Dispatch(**copy, {(*in)->All(), (*out)->All()}, Push{2}, {1});
  auto commands = (*recorder)->Finish();
  PLUMB_ASSERT_OK(commands);
  PLUMB_ASSERT_OK((*commands)->Run());
  PLUMB_ASSERT_OK((*commands)->Run());
  EXPECT_EQ(std::memcmp((*out)->Data(), values.data(), sizeof(values)), 0);
  EXPECT_EQ(lock.locked, 2);
  EXPECT_EQ(lock.unlocked, 2);
  EXPECT_THAT((*device)->ValidationMessages(), ::testing::IsEmpty());
}

TEST_F(HostDeviceTest, LeavesTheHostsDeviceAlive) {
  {
    const Result<std::shared_ptr<Device>> device = Device::Adopt(Host());
    PLUMB_ASSERT_OK(device);
  }
  const auto wait_idle =
      reinterpret_cast<PFN_vkDeviceWaitIdle>(vkGetInstanceProcAddr(instance_, "vkDeviceWaitIdle"));
  EXPECT_EQ(wait_idle(host_device_), VK_SUCCESS);
}

TEST_F(HostDeviceTest, AMissingHandleIsNamed) {
  const std::pair<void * HostDevice::*, const char*> members[] = {
      {&HostDevice::get_instance_proc_addr, "get_instance_proc_addr"},
      {&HostDevice::instance, "instance"},
      {&HostDevice::physical_device, "physical_device"},
      {&HostDevice::device, "device is null"},
      {&HostDevice::queue, "queue"}};
  for (const auto& [member, name] : members) {
    HostDevice host = Host();
    host.*member = nullptr;
    const Result<std::shared_ptr<Device>> device = Device::Adopt(host);
    ASSERT_FALSE(device) << name;
    EXPECT_EQ(device.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(device.error().message, HasSubstr(name));
  }
}

TEST_F(HostDeviceTest, ALockWithoutUnlockIsRefused) {
  HostDevice host = Host();
  host.lock_queue = [](void*) {};
  const Result<std::shared_ptr<Device>> device = Device::Adopt(host);
  ASSERT_FALSE(device);
  EXPECT_THAT(device.error().message, HasSubstr("unlock_queue"));
}

}  // namespace
}  // namespace plumb::gpu
