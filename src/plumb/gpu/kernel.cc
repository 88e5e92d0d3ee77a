#include "plumb/gpu/kernel.h"

#include <algorithm>
#include <utility>

#include "plumb/gpu/vulkan_api.h"

namespace plumb::gpu {
namespace {

constexpr uint32_t kSpirvMagic = 0x07230203;

Status Check(const KernelInfo& info, const DeviceLimits& limits) {
  const auto fail = [&](ErrorCode code, const std::string& what) -> Status {
    return Error{code, "kernel '" + info.name + "': " + what};
  };
  if (info.spirv.size() < 5 || info.spirv[0] != kSpirvMagic) {
    return fail(ErrorCode::kInvalidArgument, "its code is not SPIR-V");
  }
  if (info.push_constant_bytes % 4 != 0) {
    return fail(ErrorCode::kInvalidArgument, "push_constant_bytes " +
                                                 std::to_string(info.push_constant_bytes) +
                                                 " is not a multiple of 4");
  }
  if (info.push_constant_bytes > limits.max_push_constant_bytes) {
    return fail(ErrorCode::kUnsupported,
                "push_constant_bytes " + std::to_string(info.push_constant_bytes) +
                    " is more than the device's " + std::to_string(limits.max_push_constant_bytes));
  }
  for (size_t i = 0; i < info.bindings.size(); ++i) {
    const KernelBinding& binding = info.bindings[i];
    if (binding.kind != BindingKind::kStorage && binding.access == Access::kWrite) {
      return fail(ErrorCode::kInvalidArgument,
                  "texel buffer " + std::to_string(binding.binding) + " cannot be written");
    }
    for (size_t j = 0; j < i; ++j) {
      if (info.bindings[j].binding == binding.binding) {
        return fail(ErrorCode::kInvalidArgument,
                    "binding " + std::to_string(binding.binding) + " is listed twice");
      }
    }
  }
  return Ok();
}

}  // namespace

Kernel::Kernel(std::shared_ptr<Device> device, const KernelInfo& info)
    : device_(std::move(device)),
      name_(info.name),
      bindings_(info.bindings),
      push_constant_bytes_(info.push_constant_bytes) {}

Kernel::~Kernel() {
  const VulkanDevice& vulkan = device_->Vulkan();
  vulkan.table.vkDestroyPipeline(vulkan.handle, static_cast<VkPipeline>(pipeline_), nullptr);
  vulkan.table.vkDestroyPipelineLayout(vulkan.handle,
                                       static_cast<VkPipelineLayout>(pipeline_layout_), nullptr);
  vulkan.table.vkDestroyDescriptorSetLayout(
      vulkan.handle, static_cast<VkDescriptorSetLayout>(set_layout_), nullptr);
}

Result<std::unique_ptr<Kernel>> Kernel::Create(std::shared_ptr<Device> device,
                                               const KernelInfo& info) {
  const VulkanDevice& vulkan = device->Vulkan();
  if (const Status valid = Check(info, vulkan.info.limits); !valid) return valid.error();
  std::unique_ptr<Kernel> kernel(new Kernel(std::move(device), info));

  std::vector<VkDescriptorSetLayoutBinding> bindings;
  for (const KernelBinding& binding : info.bindings) {
    VkDescriptorSetLayoutBinding entry{};
    entry.binding = binding.binding;
    entry.descriptorType = binding.kind == BindingKind::kStorage
                               ? VK_DESCRIPTOR_TYPE_STORAGE_BUFFER
                               : VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER;
    entry.descriptorCount = 1;
    entry.stageFlags = VK_SHADER_STAGE_COMPUTE_BIT;
    bindings.push_back(entry);
  }
  auto set_info = MakeInfo<VkDescriptorSetLayoutCreateInfo>(
      VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  set_info.bindingCount = static_cast<uint32_t>(bindings.size());
  set_info.pBindings = bindings.data();
  VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
  PLUMB_VK_RETURN(
      "vkCreateDescriptorSetLayout",
      vulkan.table.vkCreateDescriptorSetLayout(vulkan.handle, &set_info, nullptr, &set_layout));
  kernel->set_layout_ = set_layout;

  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, info.push_constant_bytes};
  auto layout_info =
      MakeInfo<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout_info.setLayoutCount = 1;
  layout_info.pSetLayouts = &set_layout;
  layout_info.pushConstantRangeCount = info.push_constant_bytes > 0 ? 1 : 0;
  layout_info.pPushConstantRanges = &push;
  VkPipelineLayout pipeline_layout = VK_NULL_HANDLE;
  PLUMB_VK_RETURN(
      "vkCreatePipelineLayout",
      vulkan.table.vkCreatePipelineLayout(vulkan.handle, &layout_info, nullptr, &pipeline_layout));
  kernel->pipeline_layout_ = pipeline_layout;

  std::vector<VkSpecializationMapEntry> entries;
  std::vector<uint32_t> values;
  for (const SpecConstant& constant : info.spec_constants) {
    entries.push_back(
        {constant.id, static_cast<uint32_t>(values.size() * sizeof(uint32_t)), sizeof(uint32_t)});
    values.push_back(constant.bits);
  }
  VkSpecializationInfo specialization{};
  specialization.mapEntryCount = static_cast<uint32_t>(entries.size());
  specialization.pMapEntries = entries.data();
  specialization.dataSize = values.size() * sizeof(uint32_t);
  specialization.pData = values.data();

  auto module_info =
      MakeInfo<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  module_info.codeSize = info.spirv.size_bytes();
  module_info.pCode = info.spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  PLUMB_VK_RETURN("vkCreateShaderModule",
                  vulkan.table.vkCreateShaderModule(vulkan.handle, &module_info, nullptr, &module));

  auto pipeline_info =
      MakeInfo<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  pipeline_info.stage = MakeInfo<VkPipelineShaderStageCreateInfo>(
      VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO);
  pipeline_info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  pipeline_info.stage.module = module;
  pipeline_info.stage.pName = "main";
  pipeline_info.stage.pSpecializationInfo = entries.empty() ? nullptr : &specialization;
  pipeline_info.layout = pipeline_layout;
  VkPipeline pipeline = VK_NULL_HANDLE;
  const VkResult result = vulkan.table.vkCreateComputePipelines(vulkan.handle, VK_NULL_HANDLE, 1,
                                                                &pipeline_info, nullptr, &pipeline);
  vulkan.table.vkDestroyShaderModule(vulkan.handle, module, nullptr);
  if (result != VK_SUCCESS) {
    Error error = VulkanError("vkCreateComputePipelines", result);
    error.message = "kernel '" + info.name + "': " + error.message;
    return error;
  }
  kernel->pipeline_ = pipeline;
  vulkan.SetName(VK_OBJECT_TYPE_PIPELINE, HandleBits(pipeline), info.name);
  return kernel;
}

}  // namespace plumb::gpu
