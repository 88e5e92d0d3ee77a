// The Vulkan objects of one recording; shared by recorder.cc and command_list.cc.
#pragma once

#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "plumb/gpu/command_list.h"
#include "plumb/gpu/vulkan_api.h"

namespace plumb::gpu {

struct CommandList::Resources {
  explicit Resources(std::shared_ptr<Device> owner) : device(std::move(owner)) {}
  ~Resources();
  Resources(const Resources&) = delete;
  Resources& operator=(const Resources&) = delete;

  std::shared_ptr<Device> device;
  std::string name;
  VkCommandPool command_pool = VK_NULL_HANDLE;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  VkFence fence = VK_NULL_HANDLE;
  std::vector<VkDescriptorPool> descriptor_pools;

  // (buffer, offset, size, format) -> view
  using ViewKey = std::tuple<VkBuffer, uint64_t, uint64_t, VkFormat>;
  std::map<ViewKey, VkBufferView> views;

  VkQueryPool queries = VK_NULL_HANDLE;
  std::vector<std::string> stages;  // stage i lies between queries i and i + 1
};

}  // namespace plumb::gpu
