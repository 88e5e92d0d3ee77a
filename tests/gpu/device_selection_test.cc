// Which device a selector means, without any device.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "plumb/gpu/device.h"

namespace plumb::gpu {
namespace {

using ::testing::HasSubstr;

DeviceInfo Make(const std::string& name, DeviceType type, const std::string& unusable = "") {
  DeviceInfo info;
  info.name = name;
  info.type = type;
  info.unusable_because = unusable;
  return info;
}

std::vector<DeviceInfo> Machine() {
  return {Make("llvmpipe (LLVM 15)", DeviceType::kCpu), Make("Intel UHD", DeviceType::kIntegrated),
          Make("NVIDIA H100", DeviceType::kDiscrete), Make("NVIDIA H200", DeviceType::kDiscrete)};
}

size_t Select(const std::vector<DeviceInfo>& devices, const std::string& selector) {
  const Result<size_t> selected = SelectDevice(devices, selector);
  EXPECT_TRUE(selected.has_value()) << selector;
  return selected ? *selected : devices.size();
}

TEST(SelectDevice, AutoPrefersTheFirstDiscreteDevice) { EXPECT_EQ(Select(Machine(), "auto"), 2u); }

TEST(SelectDevice, AutoTakesTheCpuWhenThereIsNothingElse) {
  EXPECT_EQ(Select({Make("llvmpipe", DeviceType::kCpu)}, "auto"), 0u);
}

TEST(SelectDevice, AutoPrefersVirtualToCpuAndIntegratedToVirtual) {
  std::vector<DeviceInfo> devices = {Make("a", DeviceType::kCpu), Make("b", DeviceType::kVirtual)};
  EXPECT_EQ(Select(devices, "auto"), 1u);
  devices.push_back(Make("c", DeviceType::kIntegrated));
  EXPECT_EQ(Select(devices, "auto"), 2u);
}

TEST(SelectDevice, AutoPassesOverUnusableDevices) {
  std::vector<DeviceInfo> devices = Machine();
  devices[2].unusable_because = devices[3].unusable_because = "it has no compute queue";
  EXPECT_EQ(Select(devices, "auto"), 1u);
}

TEST(SelectDevice, CpuTakesTheSoftwareDevice) { EXPECT_EQ(Select(Machine(), "cpu"), 0u); }

TEST(SelectDevice, ANumberIsAnIndex) { EXPECT_EQ(Select(Machine(), "3"), 3u); }

TEST(SelectDevice, ANameMatchesInPartAndWithoutCase) {
  EXPECT_EQ(Select(Machine(), "h200"), 3u);
  EXPECT_EQ(Select(Machine(), "nvidia"), 2u);
  EXPECT_EQ(Select(Machine(), "LLVMPIPE"), 0u);
}

TEST(SelectDevice, AnUnknownNameIsReportedWithTheChoices) {
  const Result<size_t> selected = SelectDevice(Machine(), "radeon");
  ASSERT_FALSE(selected);
  EXPECT_EQ(selected.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(selected.error().message, HasSubstr("'radeon'"));
  EXPECT_THAT(selected.error().message, HasSubstr("1: Intel UHD"));
}

TEST(SelectDevice, AnIndexOutOfRangeIsReportedWithItsValue) {
  for (const std::string selector : {"4", "99999999999999999999999"}) {
    const Result<size_t> selected = SelectDevice(Machine(), selector);
    ASSERT_FALSE(selected);
    EXPECT_EQ(selected.error().code, ErrorCode::kNotFound);
    EXPECT_THAT(selected.error().message, HasSubstr("'" + selector + "'"));
  }
}

TEST(SelectDevice, AnUnusableIndexIsRefusedWithTheReason) {
  std::vector<DeviceInfo> devices = Machine();
  devices[1].unusable_because = "1.1 is less than Vulkan 1.2";
  const Result<size_t> selected = SelectDevice(devices, "1");
  ASSERT_FALSE(selected);
  EXPECT_EQ(selected.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(selected.error().message, HasSubstr("1.1 is less than Vulkan 1.2"));
}

TEST(SelectDevice, AnEmptySelectorIsInvalid) {
  const Result<size_t> selected = SelectDevice(Machine(), "");
  ASSERT_FALSE(selected);
  EXPECT_EQ(selected.error().code, ErrorCode::kInvalidArgument);
}

TEST(SelectDevice, WithoutDevicesNothingMatches) {
  const Result<size_t> selected = SelectDevice({}, "auto");
  ASSERT_FALSE(selected);
  EXPECT_THAT(selected.error().message, HasSubstr("there is no Vulkan device"));
}

TEST(DescribeDevice, CallsACpuASoftwareDevice) {
  DeviceInfo info = Make("llvmpipe", DeviceType::kCpu);
  info.driver_info = "Mesa 22.3.6";
  EXPECT_THAT(Describe(info), HasSubstr("software device"));
  EXPECT_THAT(Describe(info), HasSubstr("Mesa 22.3.6"));
  EXPECT_THAT(Describe(Make("H100", DeviceType::kDiscrete)), HasSubstr("discrete"));
}

}  // namespace
}  // namespace plumb::gpu
