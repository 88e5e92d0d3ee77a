// A compute shader with its specialization and the table of what it reads and writes.
#pragma once

#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/gpu/device.h"

namespace plumb::gpu {

enum class Access { kRead, kWrite };

/// How a slice appears in the shader. Texel buffers are samplerBuffer / usamplerBuffer, read-only.
enum class BindingKind {
  kStorage,
  kTexelRgba32F,
  kTexelR32F,
  kTexelRgba16F,
  kTexelR32Uint,
  kTexelR8Uint,
};

/// One entry of the binding table; `access` must match the shader's readonly / writeonly.
struct KernelBinding {
  uint32_t binding = 0;  // layout(binding = N), set 0
  BindingKind kind = BindingKind::kStorage;
  Access access = Access::kRead;
};

struct SpecConstant {
  uint32_t id = 0;
  uint32_t bits = 0;

  static SpecConstant Uint(uint32_t id, uint32_t value) { return {id, value}; }
  static SpecConstant Int(uint32_t id, int32_t value) {
    return {id, std::bit_cast<uint32_t>(value)};
  }
  static SpecConstant Float(uint32_t id, float value) {
    return {id, std::bit_cast<uint32_t>(value)};
  }
};

struct KernelInfo {
  std::string name;                 // for error messages and debuggers
  std::span<const uint32_t> spirv;  // shaders/registry.h; read during Create() only
  std::vector<KernelBinding> bindings = {};
  uint32_t push_constant_bytes = 0;  // multiple of 4
  std::vector<SpecConstant> spec_constants = {};
};

/// A pipeline, compiled at Create(); some drivers compile at the first dispatch.
class Kernel {
 public:
  /// @return kInvalidArgument for an empty or malformed KernelInfo, kUnsupported for one beyond the
  /// device's limits.
  static Result<std::unique_ptr<Kernel>> Create(std::shared_ptr<Device> device,
                                                const KernelInfo& info);
  ~Kernel();
  Kernel(const Kernel&) = delete;
  Kernel& operator=(const Kernel&) = delete;

  const std::string& Name() const { return name_; }
  const std::vector<KernelBinding>& Bindings() const { return bindings_; }
  uint32_t PushConstantBytes() const { return push_constant_bytes_; }

  /// Handles for gpu/*.cc: VkPipeline, VkPipelineLayout, VkDescriptorSetLayout.
  void* Pipeline() const { return pipeline_; }
  void* PipelineLayout() const { return pipeline_layout_; }
  void* SetLayout() const { return set_layout_; }

 private:
  Kernel(std::shared_ptr<Device> device, const KernelInfo& info);

  std::shared_ptr<Device> device_;
  std::string name_;
  std::vector<KernelBinding> bindings_;
  uint32_t push_constant_bytes_ = 0;
  void* set_layout_ = nullptr;
  void* pipeline_layout_ = nullptr;
  void* pipeline_ = nullptr;
};

}  // namespace plumb::gpu
