// Plans the arena, uploads constants and builds kernels once; recording allocates nothing on the
// device.
#include "plumb/nn/executor.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "plumb/gpu/transfer.h"
#include "plumb/nn/memory_plan.h"
#include "shaders/registry.h"

namespace plumb::nn {
namespace {

constexpr uint64_t kMinBufferBytes = 16;

Result<std::unique_ptr<gpu::Buffer>> MakeBuffer(const std::shared_ptr<gpu::Device>& device,
                                                const std::string& name, uint64_t bytes) {
  return gpu::Buffer::Create(device, {.name = name,
                                      .size_bytes = std::max(bytes, kMinBufferBytes),
                                      .use = gpu::MemoryUse::kDevice});
}

bool Equal(const gpu::SpecConstant& a, const gpu::SpecConstant& b) {
  return a.id == b.id && a.bits == b.bits;
}

}  // namespace

Result<std::unique_ptr<Executor>> Executor::Create(std::shared_ptr<gpu::Device> device,
                                                   const DispatchPlan& plan,
                                                   const ExecutorOptions& options) {
  std::unique_ptr<Executor> executor(new Executor(std::move(device)));
  std::vector<gpu::BufferSlice> constants;
  if (const Status status = executor->PlaceTensors(plan, options); !status) return status.error();
  if (const Status status = executor->Upload(plan, constants); !status) return status.error();
  for (size_t i = 0; i < plan.dispatches.size(); ++i) {
    const DispatchInfo& dispatch = plan.dispatches[i];
    auto kernel = executor->FindKernel(dispatch);
    if (!kernel) {
      return Error{kernel.error().code,
                   "network layer " + dispatch.name + ": " + kernel.error().message};
    }
    Step step;
    step.name = dispatch.name;
    step.kernel = *kernel;
    step.constants = constants[i];
    step.groups = dispatch.groups;
    step.pushes_address = dispatch.pushes_address;
    const auto push = std::as_bytes(std::span(dispatch.push));
    step.push.assign(push.begin(), push.end());
    if (dispatch.pushes_address) {
      const uint64_t address = executor->weights_->Address() + constants[i].offset_bytes;
      const auto address_bytes = std::as_bytes(std::span(&address, 1));
      step.push.insert(step.push.end(), address_bytes.begin(), address_bytes.end());
    }
    for (const Operand& operand : dispatch.operands) {
      step.slices.push_back(operand.tensor == Operand::kConstants
                                ? constants[i]
                                : executor->tensors_[operand.tensor]);
    }
    executor->steps_.push_back(std::move(step));
  }
  return executor;
}

// All constants in one buffer, each part aligned for any binding.
Status Executor::Upload(const DispatchPlan& plan, std::vector<gpu::BufferSlice>& constants) {
  gpu::BufferLayout layout(*device_);
  std::vector<uint64_t> offsets;
  for (const DispatchInfo& dispatch : plan.dispatches) {
    offsets.push_back(layout.Append(dispatch.constants.size() * sizeof(float)));
  }
  std::vector<std::byte> bytes(std::max(layout.SizeBytes(), kMinBufferBytes));
  auto buffer = MakeBuffer(device_, "network weights", bytes.size());
  if (!buffer) return buffer.error();
  weights_ = *std::move(buffer);
  for (size_t i = 0; i < offsets.size(); ++i) {
    const std::vector<float>& values = plan.dispatches[i].constants;
    const uint64_t size = values.size() * sizeof(float);
    if (size > 0) std::memcpy(bytes.data() + offsets[i], values.data(), size);
    constants.push_back({weights_.get(), offsets[i], size});
  }
  return gpu::UploadNow(device_, weights_->All(), bytes);
}

Status Executor::PlaceTensors(const DispatchPlan& plan, const ExecutorOptions& options) {
  const auto has_own_buffer = [&](int tensor) {
    return std::ranges::find(options.own_buffers, tensor) != options.own_buffers.end();
  };
  std::vector<std::vector<int>> uses;
  for (const DispatchInfo& dispatch : plan.dispatches) {
    uses.emplace_back();
    for (const Operand& operand : dispatch.operands) {
      if (operand.tensor != Operand::kConstants && !has_own_buffer(operand.tensor)) {
        uses.back().push_back(operand.tensor);
      }
    }
  }
  const uint64_t limit = device_->Info().limits.max_storage_buffer_bytes;
  for (const size_t bytes : plan.tensor_bytes) {
    if (bytes > limit) {
      return Error{ErrorCode::kUnsupported, "network: an activation of " + std::to_string(bytes) +
                                                " bytes exceeds the " + std::to_string(limit) +
                                                " bytes that a kernel can bind on " +
                                                device_->Info().name};
    }
  }
  std::vector<LiveRange> ranges = LiveRanges(uses, plan.tensor_bytes);
  if (!options.shares_memory) {
    for (LiveRange& range : ranges) {
      if (range.first <= range.last) range = {.bytes = range.bytes, .first = 0, .last = 0};
    }
  }
  const MemoryPlan memory = PlanMemory(ranges, device_->Info().limits.buffer_offset_alignment);
  auto arena = MakeBuffer(device_, "network activations", memory.total_bytes);
  if (!arena) return arena.error();
  arena_ = *std::move(arena);
  for (size_t i = 0; i < plan.tensor_bytes.size(); ++i) {
    if (has_own_buffer(static_cast<int>(i))) {
      auto buffer = MakeBuffer(device_, "network tensor", plan.tensor_bytes[i]);
      if (!buffer) return buffer.error();
      own_buffers_.push_back(*std::move(buffer));
      tensors_.push_back(own_buffers_.back()->All());
    } else {
      tensors_.push_back({arena_.get(), memory.offsets[i], plan.tensor_bytes[i]});
    }
  }
  return Ok();
}

Result<const gpu::Kernel*> Executor::FindKernel(const DispatchInfo& dispatch) {
  for (const CachedKernel& cached : kernels_) {
    if (cached.shader == dispatch.shader &&
        std::ranges::equal(cached.spec_constants, dispatch.spec_constants, Equal)) {
      return cached.kernel.get();
    }
  }
  gpu::KernelInfo info;
  info.name = dispatch.shader;
  info.spirv = shaders::Find(dispatch.shader);
  for (size_t i = 0; i < dispatch.operands.size(); ++i) {
    const Operand& operand = dispatch.operands[i];
    info.bindings.push_back(
        {.binding = static_cast<uint32_t>(i), .kind = operand.kind, .access = operand.access});
  }
  info.push_constant_bytes = static_cast<uint32_t>(
      dispatch.push.size() * sizeof(uint32_t) + (dispatch.pushes_address ? sizeof(uint64_t) : 0));
  info.spec_constants = dispatch.spec_constants;
  auto kernel = gpu::Kernel::Create(device_, std::move(info));
  if (!kernel) return kernel.error();
  kernels_.push_back({dispatch.shader, dispatch.spec_constants, *std::move(kernel)});
  return kernels_.back().kernel.get();
}

void Executor::Record(gpu::Recorder& recorder, bool stage_per_dispatch) const {
  for (const Step& step : steps_) {
    if (stage_per_dispatch) recorder.BeginStage(step.name);
    const gpu::AddressAccess access{.slice = step.constants, .access = gpu::Access::kRead};
    recorder.Dispatch(*step.kernel, step.slices, step.push, step.groups,
                      std::span(&access, step.pushes_address ? 1 : 0));
  }
}

}  // namespace plumb::nn
