#include "plumb/gpu/command_list.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "plumb/gpu/command_list_resources.h"

namespace plumb::gpu {

CommandList::Resources::~Resources() {
  const VulkanDevice& vulkan = device->Vulkan();
  for (const auto& [key, view] : views) {
    vulkan.table.vkDestroyBufferView(vulkan.handle, view, nullptr);
  }
  for (const VkDescriptorPool pool : descriptor_pools) {
    vulkan.table.vkDestroyDescriptorPool(vulkan.handle, pool, nullptr);
  }
  vulkan.table.vkDestroyQueryPool(vulkan.handle, queries, nullptr);
  vulkan.table.vkDestroyFence(vulkan.handle, fence, nullptr);
  vulkan.table.vkDestroyCommandPool(vulkan.handle, command_pool, nullptr);
}

CommandList::CommandList(std::shared_ptr<Device> device, std::unique_ptr<Resources> resources)
    : device_(std::move(device)), resources_(std::move(resources)) {
  if (resources_->queries != VK_NULL_HANDLE) {
    timestamps_.resize(resources_->stages.size() + 1);
    for (const std::string& stage : resources_->stages) stage_times_.push_back({stage, 0});
  }
}

CommandList::~CommandList() {
  if (!in_flight_) return;
  const VulkanDevice& vulkan = device_->Vulkan();
  vulkan.table.vkWaitForFences(vulkan.handle, 1, &resources_->fence, VK_TRUE, UINT64_MAX);
}

Status CommandList::Submit() {
  if (in_flight_) {
    return Error{ErrorCode::kInvalidArgument,
                 "command list '" + resources_->name + "' is in flight already"};
  }
  const VulkanDevice& vulkan = device_->Vulkan();
  PLUMB_VK_RETURN("vkResetFences",
                  vulkan.table.vkResetFences(vulkan.handle, 1, &resources_->fence));
  auto submit = MakeInfo<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &resources_->commands;
  PLUMB_VK_RETURN("vkQueueSubmit", vulkan.Submit(submit, resources_->fence));
  in_flight_ = true;
  return Ok();
}

Result<WaitResult> CommandList::Wait(std::chrono::nanoseconds timeout) {
  if (!in_flight_) return WaitResult::kDone;
  const VulkanDevice& vulkan = device_->Vulkan();
  const auto timeout_ns = static_cast<uint64_t>(std::max<int64_t>(0, timeout.count()));
  const VkResult result =
      vulkan.table.vkWaitForFences(vulkan.handle, 1, &resources_->fence, VK_TRUE, timeout_ns);
  if (result == VK_TIMEOUT) return WaitResult::kTimeout;
  in_flight_ = false;
  if (result != VK_SUCCESS) return VulkanError("vkWaitForFences", result);
  if (const Status read = ReadStageTimes(); !read) return read.error();
  return WaitResult::kDone;
}

Status CommandList::Run(std::chrono::nanoseconds timeout) {
  if (const Status submitted = Submit(); !submitted) return submitted.error();
  const Result<WaitResult> waited = Wait(timeout);
  if (!waited) return waited.error();
  if (*waited == WaitResult::kTimeout) {
    return Error{ErrorCode::kInternal, "command list '" + resources_->name +
                                           "' did not finish within " +
                                           std::to_string(timeout.count()) + " ns"};
  }
  return Ok();
}

Status CommandList::ReadStageTimes() {
  if (timestamps_.empty()) return Ok();
  const VulkanDevice& vulkan = device_->Vulkan();
  PLUMB_VK_RETURN(
      "vkGetQueryPoolResults",
      vulkan.table.vkGetQueryPoolResults(
          vulkan.handle, resources_->queries, 0, static_cast<uint32_t>(timestamps_.size()),
          timestamps_.size() * sizeof(uint64_t), timestamps_.data(), sizeof(uint64_t),
          VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT));
  for (size_t i = 0; i < stage_times_.size(); ++i) {
    const auto ticks = static_cast<double>(timestamps_[i + 1] - timestamps_[i]);
    stage_times_[i].duration_ns =
        static_cast<int64_t>(std::llround(ticks * vulkan.info.timestamp_period_ns));
  }
  return Ok();
}

}  // namespace plumb::gpu
