#include "plumb/gpu/recorder.h"

#include <algorithm>
#include <utility>

#include "plumb/gpu/command_list_resources.h"
#include "plumb/gpu/vulkan_api.h"

namespace plumb::gpu {
namespace {

constexpr uint32_t kMaxStages = 255;
constexpr uint32_t kSetsPerPool = 64;
constexpr uint32_t kDescriptorsPerPool = 512;

constexpr VkPipelineStageFlags kDeviceStages =
    VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;
constexpr VkAccessFlags kDeviceWrites = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
constexpr VkAccessFlags kDeviceAccesses =
    kDeviceWrites | VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_TRANSFER_READ_BIT;

VkFormat FormatOf(BindingKind kind) {
  switch (kind) {
    case BindingKind::kTexelRgba32F:
      return VK_FORMAT_R32G32B32A32_SFLOAT;
    case BindingKind::kTexelR32F:
      return VK_FORMAT_R32_SFLOAT;
    case BindingKind::kTexelRgba16F:
      return VK_FORMAT_R16G16B16A16_SFLOAT;
    case BindingKind::kTexelR32Uint:
      return VK_FORMAT_R32_UINT;
    case BindingKind::kTexelR8Uint:
      return VK_FORMAT_R8_UINT;
    case BindingKind::kStorage:
      break;
  }
  return VK_FORMAT_UNDEFINED;
}

uint64_t TexelBytes(BindingKind kind) {
  switch (kind) {
    case BindingKind::kTexelRgba32F:
      return 16;
    case BindingKind::kTexelRgba16F:
      return 8;
    case BindingKind::kTexelR32F:
    case BindingKind::kTexelR32Uint:
      return 4;
    case BindingKind::kTexelR8Uint:
    case BindingKind::kStorage:
      return 1;
  }
  return 1;
}

BufferUse UseOf(const BufferSlice& slice, bool is_write) {
  return {slice.buffer, slice.offset_bytes, slice.offset_bytes + slice.size_bytes, is_write};
}

VkBuffer HandleOf(const BufferSlice& slice) {
  return static_cast<VkBuffer>(slice.buffer->Handle());
}

void MemoryBarrier(const VulkanDevice& vulkan, VkCommandBuffer commands,
                   VkPipelineStageFlags to_stages, VkAccessFlags to_accesses) {
  auto barrier = MakeInfo<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  barrier.srcAccessMask = kDeviceWrites;
  barrier.dstAccessMask = to_accesses;
  vulkan.table.vkCmdPipelineBarrier(commands, kDeviceStages, to_stages, 0, 1, &barrier, 0, nullptr,
                                    0, nullptr);
}

}  // namespace

Recorder::Recorder(std::shared_ptr<Device> device, RecorderOptions options)
    : device_(std::move(device)), options_(std::move(options)) {}

Recorder::~Recorder() = default;

Result<std::unique_ptr<Recorder>> Recorder::Create(const std::shared_ptr<Device>& device,
                                                   RecorderOptions options) {
  const VulkanDevice& vulkan = device->Vulkan();
  std::unique_ptr<Recorder> recorder(new Recorder(device, std::move(options)));
  recorder->resources_ = std::make_unique<CommandList::Resources>(device);
  CommandList::Resources& resources = *recorder->resources_;
  resources.name = recorder->options_.name;

  auto pool_info = MakeInfo<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  pool_info.queueFamilyIndex = vulkan.queue_family;
  PLUMB_VK_RETURN("vkCreateCommandPool",
                  vulkan.table.vkCreateCommandPool(vulkan.handle, &pool_info, nullptr,
                                                   &resources.command_pool));
  auto allocate =
      MakeInfo<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
  allocate.commandPool = resources.command_pool;
  allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  allocate.commandBufferCount = 1;
  PLUMB_VK_RETURN("vkAllocateCommandBuffers", vulkan.table.vkAllocateCommandBuffers(
                                                  vulkan.handle, &allocate, &resources.commands));
  const VkFenceCreateInfo fence_info{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, 0};
  PLUMB_VK_RETURN("vkCreateFence", vulkan.table.vkCreateFence(vulkan.handle, &fence_info, nullptr,
                                                              &resources.fence));
  if (recorder->options_.has_stage_times && vulkan.info.timestamp_period_ns > 0.0) {
    auto query_info = MakeInfo<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
    query_info.queryType = VK_QUERY_TYPE_TIMESTAMP;
    query_info.queryCount = kMaxStages + 1;
    PLUMB_VK_RETURN(
        "vkCreateQueryPool",
        vulkan.table.vkCreateQueryPool(vulkan.handle, &query_info, nullptr, &resources.queries));
  }

  const VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, 0,
                                       nullptr};
  PLUMB_VK_RETURN("vkBeginCommandBuffer",
                  vulkan.table.vkBeginCommandBuffer(resources.commands, &begin));
  if (resources.queries != VK_NULL_HANDLE) {
    vulkan.table.vkCmdResetQueryPool(resources.commands, resources.queries, 0, kMaxStages + 1);
  }
  // Orders this list after whatever was submitted to the queue before, its own last run included.
  MemoryBarrier(vulkan, resources.commands, kDeviceStages, kDeviceAccesses);
  return recorder;
}

void Recorder::Fail(ErrorCode code, const std::string& what) {
  if (!error_) error_ = Error{code, "recorder '" + options_.name + "': " + what};
}

void Recorder::BeginStage(const std::string& name) {
  CommandList::Resources& resources = *resources_;
  if (resources.stages.size() == kMaxStages) {
    return Fail(ErrorCode::kInvalidArgument, "stage '" + name + "' is one too many");
  }
  if (resources.queries != VK_NULL_HANDLE) {
    device_->Vulkan().table.vkCmdWriteTimestamp(
        resources.commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, resources.queries,
        static_cast<uint32_t>(resources.stages.size()));
  }
  resources.stages.push_back(name);
}

bool Recorder::CheckSlice(const BufferSlice& slice, const std::string& user) {
  if (slice.buffer == nullptr) {
    Fail(ErrorCode::kInvalidArgument, user + ": a slice without buffer");
    return false;
  }
  const uint64_t size = slice.buffer->SizeBytes();
  if (slice.size_bytes == 0 || slice.offset_bytes > size ||
      slice.size_bytes > size - slice.offset_bytes) {
    Fail(ErrorCode::kInvalidArgument, user + ": slice of " + std::to_string(slice.size_bytes) +
                                          " bytes at " + std::to_string(slice.offset_bytes) +
                                          " is not inside buffer '" + slice.buffer->Name() +
                                          "' of " + std::to_string(size) + " bytes");
    return false;
  }
  return true;
}

bool Recorder::CheckDispatch(const Kernel& kernel, std::span<const BufferSlice> buffers,
                             std::span<const std::byte> push, Groups groups) {
  const DeviceLimits& limits = device_->Info().limits;
  const auto fail = [&](const std::string& what) {
    Fail(ErrorCode::kInvalidArgument, "kernel '" + kernel.Name() + "': " + what);
    return false;
  };
  if (buffers.size() != kernel.Bindings().size()) {
    return fail(std::to_string(buffers.size()) + " buffers for " +
                std::to_string(kernel.Bindings().size()) + " bindings");
  }
  if (push.size() != kernel.PushConstantBytes()) {
    return fail(std::to_string(push.size()) + " bytes of push constants instead of " +
                std::to_string(kernel.PushConstantBytes()));
  }
  const uint32_t counts[3] = {groups.x, groups.y, groups.z};
  for (int axis = 0; axis < 3; ++axis) {
    if (counts[axis] == 0 || counts[axis] > limits.max_workgroup_count[axis]) {
      return fail("workgroup count " + std::to_string(counts[axis]) + " on axis " +
                  std::to_string(axis) + " is outside 1.." +
                  std::to_string(limits.max_workgroup_count[axis]));
    }
  }
  for (size_t i = 0; i < buffers.size(); ++i) {
    const BufferSlice& slice = buffers[i];
    const KernelBinding& binding = kernel.Bindings()[i];
    const std::string where = "binding " + std::to_string(binding.binding);
    if (!CheckSlice(slice, "kernel '" + kernel.Name() + "', " + where)) return false;
    if (slice.offset_bytes % limits.buffer_offset_alignment != 0) {
      return fail(where + " starts at " + std::to_string(slice.offset_bytes) +
                  ", not a multiple of " + std::to_string(limits.buffer_offset_alignment));
    }
    const bool is_storage = binding.kind == BindingKind::kStorage;
    const uint64_t max_bytes = is_storage
                                   ? limits.max_storage_buffer_bytes
                                   : limits.max_texel_buffer_elements * TexelBytes(binding.kind);
    if (slice.size_bytes > max_bytes) {
      return fail(where + " of " + std::to_string(slice.size_bytes) +
                  " bytes is more than the device's " + std::to_string(max_bytes));
    }
    if (slice.size_bytes % TexelBytes(binding.kind) != 0) {
      return fail(where + " of " + std::to_string(slice.size_bytes) +
                  " bytes is not a whole number of texels");
    }
  }
  return true;
}

void Recorder::Synchronize(std::span<const BufferUse> uses) {
  if (hazards_.NeedsBarrier(uses)) {
    MemoryBarrier(device_->Vulkan(), resources_->commands, kDeviceStages, kDeviceAccesses);
    hazards_.Clear();
    ++num_barriers_;
  }
  hazards_.Add(uses);
}

void Recorder::Dispatch(const Kernel& kernel, std::span<const BufferSlice> buffers,
                        std::span<const std::byte> push, Groups groups,
                        std::span<const AddressAccess> through_addresses) {
  if (error_ || !CheckDispatch(kernel, buffers, push, groups)) return;
  uses_.clear();
  for (size_t i = 0; i < buffers.size(); ++i) {
    uses_.push_back(UseOf(buffers[i], kernel.Bindings()[i].access == Access::kWrite));
  }
  for (const AddressAccess& access : through_addresses) {
    if (!CheckSlice(access.slice, "kernel '" + kernel.Name() + "', an address")) return;
    uses_.push_back(UseOf(access.slice, access.access == Access::kWrite));
  }
  // Two writes of one kernel to the same bytes may be its two ways of storing; reads may not mix.
  for (const BufferUse& read : uses_) {
    for (const BufferUse& write : uses_) {
      if (!read.is_write && write.is_write && Conflict(read, write)) {
        return Fail(ErrorCode::kInvalidArgument,
                    "kernel '" + kernel.Name() + "' reads and writes the same bytes of buffer '" +
                        static_cast<const Buffer*>(read.buffer)->Name() + "'");
      }
    }
  }

  auto* set = static_cast<VkDescriptorSet>(DescriptorSet(kernel, buffers));
  if (error_) return;
  Synchronize(uses_);
  const VolkDeviceTable& table = device_->Vulkan().table;
  VkCommandBuffer commands = resources_->commands;
  auto* layout = static_cast<VkPipelineLayout>(kernel.PipelineLayout());
  table.vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE,
                          static_cast<VkPipeline>(kernel.Pipeline()));
  if (set != VK_NULL_HANDLE) {
    table.vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout, 0, 1, &set, 0,
                                  nullptr);
  }
  if (!push.empty()) {
    table.vkCmdPushConstants(commands, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                             static_cast<uint32_t>(push.size()), push.data());
  }
  table.vkCmdDispatch(commands, groups.x, groups.y, groups.z);
  ++num_dispatches_;
}

void* Recorder::TexelView(BindingKind kind, const BufferSlice& slice) {
  const VulkanDevice& vulkan = device_->Vulkan();
  auto info = MakeInfo<VkBufferViewCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO);
  info.buffer = HandleOf(slice);
  info.format = FormatOf(kind);
  info.offset = slice.offset_bytes;
  info.range = slice.size_bytes;
  const CommandList::Resources::ViewKey key{info.buffer, info.offset, info.range, info.format};
  if (const auto found = resources_->views.find(key); found != resources_->views.end()) {
    return found->second;
  }
  VkBufferView view = VK_NULL_HANDLE;
  const VkResult result = vulkan.table.vkCreateBufferView(vulkan.handle, &info, nullptr, &view);
  if (result != VK_SUCCESS) {
    const Error error = VulkanError("vkCreateBufferView", result);
    Fail(error.code, error.message);
    return VK_NULL_HANDLE;
  }
  resources_->views.emplace(key, view);
  return view;
}

void* Recorder::DescriptorSet(const Kernel& kernel, std::span<const BufferSlice> buffers) {
  if (buffers.empty()) return VK_NULL_HANDLE;
  const VulkanDevice& vulkan = device_->Vulkan();
  auto* layout = static_cast<VkDescriptorSetLayout>(kernel.SetLayout());
  auto allocate =
      MakeInfo<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  allocate.descriptorSetCount = 1;
  allocate.pSetLayouts = &layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  VkResult result = VK_ERROR_OUT_OF_POOL_MEMORY;
  if (!resources_->descriptor_pools.empty()) {
    allocate.descriptorPool = resources_->descriptor_pools.back();
    result = vulkan.table.vkAllocateDescriptorSets(vulkan.handle, &allocate, &set);
  }
  if (result == VK_ERROR_OUT_OF_POOL_MEMORY || result == VK_ERROR_FRAGMENTED_POOL) {
    const uint32_t count = std::max(kDescriptorsPerPool, static_cast<uint32_t>(buffers.size()));
    const VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, count},
                                          {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, count}};
    auto info = MakeInfo<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
    info.maxSets = kSetsPerPool;
    info.poolSizeCount = 2;
    info.pPoolSizes = sizes;
    VkDescriptorPool pool = VK_NULL_HANDLE;
    result = vulkan.table.vkCreateDescriptorPool(vulkan.handle, &info, nullptr, &pool);
    if (result == VK_SUCCESS) {
      resources_->descriptor_pools.push_back(pool);
      allocate.descriptorPool = pool;
      result = vulkan.table.vkAllocateDescriptorSets(vulkan.handle, &allocate, &set);
    }
  }
  if (result != VK_SUCCESS) {
    const Error error = VulkanError("vkAllocateDescriptorSets", result);
    Fail(error.code, error.message);
    return VK_NULL_HANDLE;
  }

  std::vector<VkDescriptorBufferInfo> infos(buffers.size());
  std::vector<VkBufferView> views(buffers.size());
  std::vector<VkWriteDescriptorSet> writes(buffers.size());
  for (size_t i = 0; i < buffers.size(); ++i) {
    const KernelBinding& binding = kernel.Bindings()[i];
    VkWriteDescriptorSet& write = writes[i];
    write = MakeInfo<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
    write.dstSet = set;
    write.dstBinding = binding.binding;
    write.descriptorCount = 1;
    if (binding.kind == BindingKind::kStorage) {
      infos[i] = {HandleOf(buffers[i]), buffers[i].offset_bytes, buffers[i].size_bytes};
      write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
      write.pBufferInfo = &infos[i];
    } else {
      views[i] = static_cast<VkBufferView>(TexelView(binding.kind, buffers[i]));
      if (error_) return VK_NULL_HANDLE;
      write.descriptorType = VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER;
      write.pTexelBufferView = &views[i];
    }
  }
  vulkan.table.vkUpdateDescriptorSets(vulkan.handle, static_cast<uint32_t>(writes.size()),
                                      writes.data(), 0, nullptr);
  return set;
}

void Recorder::Copy(const BufferSlice& from, const BufferSlice& to) {
  if (error_ || !CheckSlice(from, "Copy, from") || !CheckSlice(to, "Copy, to")) return;
  const BufferUse uses[] = {UseOf(from, false), UseOf(to, true)};
  if (from.size_bytes != to.size_bytes || Conflict(uses[0], uses[1])) {
    return Fail(ErrorCode::kInvalidArgument, "Copy from '" + from.buffer->Name() + "' to '" +
                                                 to.buffer->Name() +
                                                 "': the sizes differ or the slices overlap");
  }
  Synchronize(uses);
  const VkBufferCopy region{from.offset_bytes, to.offset_bytes, from.size_bytes};
  device_->Vulkan().table.vkCmdCopyBuffer(resources_->commands, HandleOf(from), HandleOf(to), 1,
                                          &region);
}

void Recorder::Fill(const BufferSlice& slice, uint32_t value) {
  if (error_ || !CheckSlice(slice, "Fill")) return;
  if (slice.offset_bytes % 4 != 0 || slice.size_bytes % 4 != 0) {
    return Fail(ErrorCode::kInvalidArgument,
                "Fill of '" + slice.buffer->Name() + "': not a whole number of words");
  }
  const BufferUse use = UseOf(slice, true);
  Synchronize({&use, 1});
  device_->Vulkan().table.vkCmdFillBuffer(resources_->commands, HandleOf(slice), slice.offset_bytes,
                                          slice.size_bytes, value);
}

Result<std::unique_ptr<CommandList>> Recorder::Finish() {
  if (error_) return *error_;
  const VulkanDevice& vulkan = device_->Vulkan();
  CommandList::Resources& resources = *resources_;
  if (resources.queries != VK_NULL_HANDLE) {
    vulkan.table.vkCmdWriteTimestamp(resources.commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT,
                                     resources.queries,
                                     static_cast<uint32_t>(resources.stages.size()));
  }
  // The host reads mapped buffers after the fence.
  MemoryBarrier(vulkan, resources.commands, VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT);
  PLUMB_VK_RETURN("vkEndCommandBuffer", vulkan.table.vkEndCommandBuffer(resources.commands));
  return std::unique_ptr<CommandList>(new CommandList(device_, std::move(resources_)));
}

}  // namespace plumb::gpu
