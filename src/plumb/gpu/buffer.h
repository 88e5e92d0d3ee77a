// Device memory: one Buffer is one allocation, handed out in slices.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "plumb/base/result.h"
#include "plumb/gpu/device.h"

namespace plumb::gpu {

class Buffer;

enum class MemoryUse {
  kDevice,    // Read and written by kernels; the host reaches it through copies (transfer.h).
  kUpload,    // Written by the host through Data(), read by kernels and copies.
  kReadback,  // Written by kernels and copies, read by the host through Data(); cached.
};

/// A part of a buffer; borrowed, valid for as long as the buffer.
struct BufferSlice {
  const Buffer* buffer = nullptr;
  uint64_t offset_bytes = 0;
  uint64_t size_bytes = 0;
};

struct BufferInfo {
  std::string name;  // for error messages and debuggers
  uint64_t size_bytes = 0;
  MemoryUse use = MemoryUse::kDevice;
};

/// Every buffer can be bound as storage and as texel buffer, copied from and to, and has an address
/// where the device supports it. Few large buffers with planned slices are meant (BufferLayout):
/// each Create() is one vkAllocateMemory. Contents are undefined at first.
class Buffer {
 public:
  /// @return kInvalidArgument for size 0, kUnsupported when the device has not that much memory.
  static Result<std::unique_ptr<Buffer>> Create(std::shared_ptr<Device> device,
                                                const BufferInfo& info);
  ~Buffer();
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  const std::string& Name() const { return info_.name; }
  uint64_t SizeBytes() const { return info_.size_bytes; }
  MemoryUse Use() const { return info_.use; }

  /// Host's view, coherent, mapped for the buffer's life; null for kDevice. What the host writes
  /// before CommandList::Submit() is seen by that submission; what a submission wrote is seen after
  /// CommandList::Wait() returned kDone.
  std::byte* Data() const { return data_; }

  /// Address for buffer_reference blocks; 0 without DeviceFeatures::buffer_device_address.
  uint64_t Address() const { return address_; }

  BufferSlice All() const { return {this, 0, info_.size_bytes}; }
  /// Precondition: the slice lies inside the buffer.
  BufferSlice Slice(uint64_t offset_bytes, uint64_t size_bytes) const;

  /// VkBuffer, for gpu/*.cc.
  void* Handle() const { return handle_; }

 private:
  Buffer(std::shared_ptr<Device> device, BufferInfo info);

  std::shared_ptr<Device> device_;
  BufferInfo info_;
  void* handle_ = nullptr;  // VkBuffer
  void* memory_ = nullptr;  // VkDeviceMemory
  std::byte* data_ = nullptr;
  uint64_t address_ = 0;
};

/// Plans the slices of one buffer: append all parts, create the buffer, then slice it.
class BufferLayout {
 public:
  explicit BufferLayout(const Device& device)
      : alignment_(device.Info().limits.buffer_offset_alignment) {}

  /// @return the part's offset in bytes, aligned for every kind of binding.
  uint64_t Append(uint64_t size_bytes);
  uint64_t SizeBytes() const { return size_bytes_; }

 private:
  uint64_t alignment_;
  uint64_t size_bytes_ = 0;
};

}  // namespace plumb::gpu
