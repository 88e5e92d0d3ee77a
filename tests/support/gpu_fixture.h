// GoogleTest fixture of every test that uses a Vulkan device.
#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/gpu/buffer.h"
#include "plumb/gpu/device.h"
#include "plumb/gpu/transfer.h"

namespace plumb::testing {

/// `*result` after checking that there is one; the error message is shown otherwise.
#define PLUMB_ASSERT_OK(result) \
  ASSERT_TRUE((result).has_value()) << ((result).has_value() ? "" : (result).error().message)
#define PLUMB_EXPECT_OK(result) \
  EXPECT_TRUE((result).has_value()) << ((result).has_value() ? "" : (result).error().message)

/// Opens the device once per test suite, with validation; one message of the layer fails the
/// test during which it came. Skips, visibly, only where there is no Vulkan device at all. The
/// device goes with the suite: a device that lives until the program's static objects die makes
/// newer validation layers crash there.
class GpuTest : public ::testing::Test {
 protected:
  void SetUp() override {
    static const Result<std::vector<gpu::DeviceInfo>> devices = gpu::ListDevices();
    if (!devices) GTEST_SKIP() << devices.error().message;
    if ((*devices).empty()) GTEST_SKIP() << "no Vulkan device";
    if (shared_device_ == nullptr) {
      Result<std::shared_ptr<gpu::Device>> device =
          gpu::Device::Create({.selector = "auto", .validation = true});
      PLUMB_ASSERT_OK(device);
      shared_device_ = *std::move(device);
    }
    device_ = shared_device_;
    device_->ClearValidationMessages();
  }

  static void TearDownTestSuite() { shared_device_.reset(); }

  void TearDown() override {
    if (device_ == nullptr) return;
    for (const std::string& message : device_->ValidationMessages()) ADD_FAILURE() << message;
  }

  /// A buffer that holds `values`.
  template <typename T>
  std::unique_ptr<gpu::Buffer> MakeBuffer(const std::vector<T>& values,
                                          gpu::MemoryUse use = gpu::MemoryUse::kDevice) {
    Result<std::unique_ptr<gpu::Buffer>> buffer =
        gpu::Buffer::Create(device_, {"test", values.size() * sizeof(T), use});
    if (!buffer) {
      ADD_FAILURE() << buffer.error().message;
      return nullptr;
    }
    PLUMB_EXPECT_OK(gpu::UploadNow(device_, (*buffer)->All(), std::as_bytes(std::span(values))));
    return std::move(*buffer);
  }

  /// The contents of a slice.
  template <typename T>
  std::vector<T> Read(const gpu::BufferSlice& slice) {
    std::vector<T> values(slice.size_bytes / sizeof(T));
    PLUMB_EXPECT_OK(gpu::ReadNow(device_, slice, std::as_writable_bytes(std::span(values))));
    return values;
  }

  std::shared_ptr<gpu::Device> device_;

 private:
  inline static std::shared_ptr<gpu::Device> shared_device_;
};

}  // namespace plumb::testing
