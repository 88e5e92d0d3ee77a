// Opening devices.
#include "plumb/gpu/device.h"

#include <gmock/gmock.h>

#include "support/gpu_fixture.h"

namespace plumb::gpu {
namespace {

using ::testing::HasSubstr;

class DeviceTest : public plumb::testing::GpuTest {};

TEST_F(DeviceTest, InfoIsFilled) {
  const DeviceInfo& info = device_->Info();
  EXPECT_FALSE(info.name.empty());
  EXPECT_FALSE(info.driver_info.empty());
  EXPECT_TRUE(info.unusable_because.empty());
  EXPECT_GE(info.subgroup_size, 1u);
  EXPECT_GE(info.limits.max_workgroup_invocations, 128u);
  EXPECT_GE(info.limits.max_push_constant_bytes, 128u);
  EXPECT_GE(info.limits.max_storage_buffer_bytes, uint64_t{1} << 27);
  EXPECT_GE(info.limits.buffer_offset_alignment, 64u);
}

TEST_F(DeviceTest, LavapipeIsASoftwareDevice) {
  if (!device_->Info().IsLavapipe()) GTEST_SKIP() << "not lavapipe: " << device_->Info().name;
  EXPECT_TRUE(device_->Info().IsSoftware());
  EXPECT_TRUE(device_->Info().features.buffer_device_address);
  EXPECT_TRUE(device_->Info().subgroup_shuffle);
}

TEST_F(DeviceTest, TheListHoldsTheOpenDevice) {
  const Result<std::vector<DeviceInfo>> devices = ListDevices();
  PLUMB_ASSERT_OK(devices);
  const uint32_t index = device_->Info().index;
  ASSERT_LT(index, (*devices).size());
  EXPECT_EQ((*devices)[index].name, device_->Info().name);
}

TEST_F(DeviceTest, IsFoundByIndexAndByName) {
  for (const std::string& selector :
       {std::to_string(device_->Info().index), device_->Info().name}) {
    const Result<std::shared_ptr<Device>> device = Device::Create({.selector = selector});
    PLUMB_ASSERT_OK(device);
    EXPECT_EQ((*device)->Info().name, device_->Info().name);
  }
}

TEST_F(DeviceTest, AnUnknownSelectorIsNamedInTheError) {
  const Result<std::shared_ptr<Device>> device = Device::Create({.selector = "no such device"});
  ASSERT_FALSE(device);
  EXPECT_EQ(device.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(device.error().message, HasSubstr("'no such device'"));
  EXPECT_THAT(device.error().message, HasSubstr(device_->Info().name));
}

TEST_F(DeviceTest, TheLogAnnouncesTheDeviceAndSaysIfItIsSoftware) {
  std::vector<std::string> lines;
  const Result<std::shared_ptr<Device>> device =
      Device::Create({.selector = std::to_string(device_->Info().index),
                      .validation = false,
                      .log = [&](const std::string& line) { lines.push_back(line); }});
  PLUMB_ASSERT_OK(device);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_THAT(lines[0], HasSubstr(device_->Info().name));
  EXPECT_EQ(lines[0].find("software device") != std::string::npos, device_->Info().IsSoftware());
}

TEST_F(DeviceTest, WithoutValidationThereAreNoMessages) {
  const Result<std::shared_ptr<Device>> device = Device::Create({.selector = "auto"});
  PLUMB_ASSERT_OK(device);
  EXPECT_EQ((*device)->NumValidationMessages(), 0u);
}

}  // namespace
}  // namespace plumb::gpu
