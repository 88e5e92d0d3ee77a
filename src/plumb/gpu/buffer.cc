#include "plumb/gpu/buffer.h"

#include <cassert>
#include <optional>
#include <utility>

#include "plumb/gpu/vulkan_api.h"

namespace plumb::gpu {
namespace {

constexpr VkMemoryPropertyFlags kMapped =
    VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

// First the wish, then what every Vulkan device must offer.
std::optional<uint32_t> FindMemoryType(const VkPhysicalDeviceMemoryProperties& memory,
                                       uint32_t allowed_types, MemoryUse use) {
  VkMemoryPropertyFlags wishes[2] = {0, 0};
  switch (use) {
    case MemoryUse::kDevice:
      wishes[0] = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
      break;
    case MemoryUse::kUpload:
      wishes[0] = wishes[1] = kMapped;
      break;
    case MemoryUse::kReadback:
      wishes[0] = kMapped | VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
      wishes[1] = kMapped;
      break;
  }
  for (const VkMemoryPropertyFlags wish : wishes) {
    for (uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
      const bool is_allowed = (allowed_types >> i & 1u) != 0;
      if (is_allowed && (memory.memoryTypes[i].propertyFlags & wish) == wish) return i;
    }
  }
  return std::nullopt;
}

}  // namespace

Buffer::Buffer(std::shared_ptr<Device> device, BufferInfo info)
    : device_(std::move(device)), info_(std::move(info)) {}

Buffer::~Buffer() {
  const VulkanDevice& vulkan = device_->Vulkan();
  vulkan.table.vkDestroyBuffer(vulkan.handle, static_cast<VkBuffer>(handle_), nullptr);
  vulkan.table.vkFreeMemory(vulkan.handle, static_cast<VkDeviceMemory>(memory_), nullptr);
}

Result<std::unique_ptr<Buffer>> Buffer::Create(std::shared_ptr<Device> device,
                                               const BufferInfo& info) {
  if (info.size_bytes == 0) {
    return Error{ErrorCode::kInvalidArgument, "buffer '" + info.name + "' has size_bytes 0"};
  }
  const VulkanDevice& vulkan = device->Vulkan();
  const bool has_address = vulkan.info.features.buffer_device_address;
  std::unique_ptr<Buffer> buffer(new Buffer(std::move(device), info));

  auto create = MakeInfo<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  create.size = (info.size_bytes + 3) / 4 * 4;  // Copies and fills work in words.
  create.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT |
                 VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  if (has_address) create.usage |= VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
  VkBuffer handle = VK_NULL_HANDLE;
  PLUMB_VK_RETURN("vkCreateBuffer",
                  vulkan.table.vkCreateBuffer(vulkan.handle, &create, nullptr, &handle));
  buffer->handle_ = handle;
  vulkan.SetName(VK_OBJECT_TYPE_BUFFER, HandleBits(handle), info.name);

  VkMemoryRequirements needs{};
  vulkan.table.vkGetBufferMemoryRequirements(vulkan.handle, handle, &needs);
  const std::optional<uint32_t> type =
      FindMemoryType(vulkan.memory, needs.memoryTypeBits, info.use);
  if (!type) {
    return Error{ErrorCode::kUnsupported,
                 "buffer '" + info.name + "': the device has no suitable memory"};
  }
  auto flags = MakeInfo<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  auto allocate = MakeInfo<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  if (has_address) allocate.pNext = &flags;
  allocate.allocationSize = needs.size;
  allocate.memoryTypeIndex = *type;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  if (const VkResult result =
          vulkan.table.vkAllocateMemory(vulkan.handle, &allocate, nullptr, &memory);
      result != VK_SUCCESS) {
    Error error = VulkanError("vkAllocateMemory", result);
    error.message = "buffer '" + info.name + "' of " + std::to_string(info.size_bytes) +
                    " bytes: " + error.message;
    return error;
  }
  buffer->memory_ = memory;
  PLUMB_VK_RETURN("vkBindBufferMemory",
                  vulkan.table.vkBindBufferMemory(vulkan.handle, handle, memory, 0));
  if (info.use != MemoryUse::kDevice) {
    void* data = nullptr;
    PLUMB_VK_RETURN("vkMapMemory",
                    vulkan.table.vkMapMemory(vulkan.handle, memory, 0, VK_WHOLE_SIZE, 0, &data));
    buffer->data_ = static_cast<std::byte*>(data);
  }
  if (has_address) {
    auto address =
        MakeInfo<VkBufferDeviceAddressInfo>(VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO);
    address.buffer = handle;
    buffer->address_ = vulkan.table.vkGetBufferDeviceAddress(vulkan.handle, &address);
  }
  return buffer;
}

BufferSlice Buffer::Slice(uint64_t offset_bytes, uint64_t size_bytes) const {
  assert(offset_bytes <= info_.size_bytes && size_bytes <= info_.size_bytes - offset_bytes);
  return {this, offset_bytes, size_bytes};
}

uint64_t BufferLayout::Append(uint64_t size_bytes) {
  const uint64_t offset = (size_bytes_ + alignment_ - 1) / alignment_ * alignment_;
  size_bytes_ = offset + size_bytes;
  return offset;
}

}  // namespace plumb::gpu
