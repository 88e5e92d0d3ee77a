// Runs a dispatch plan on a device: memory, weights, pipelines, recording.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/gpu/buffer.h"
#include "plumb/gpu/device.h"
#include "plumb/gpu/kernel.h"
#include "plumb/gpu/recorder.h"
#include "plumb/nn/ops/dispatch_plan.h"

namespace plumb::nn {

struct ExecutorOptions {
  std::vector<int> own_buffers;  ///< Tensors that get a buffer of their own: input and output.
  bool shares_memory = true;     ///< False keeps every tensor's contents, for tests.
};

/// Buffers and pipelines of one dispatch plan.
class Executor {
 public:
  static Result<std::unique_ptr<Executor>> Create(std::shared_ptr<gpu::Device> device,
                                                  const DispatchPlan& plan,
                                                  const ExecutorOptions& options);

  /// Appends all dispatches. @param stage_per_dispatch begins a recorder stage for each of them.
  void Record(gpu::Recorder& recorder, bool stage_per_dispatch) const;

  /// Where a tensor lives; others may use the same bytes at other times unless options forbid it.
  const gpu::BufferSlice& Tensor(int index) const { return tensors_[index]; }

  size_t WeightBytes() const { return weights_->SizeBytes(); }
  size_t ActivationBytes() const { return arena_->SizeBytes(); }
  int NumDispatches() const { return static_cast<int>(steps_.size()); }
  int NumKernels() const { return static_cast<int>(kernels_.size()); }

 private:
  struct Step {
    std::string name;
    const gpu::Kernel* kernel = nullptr;
    std::vector<gpu::BufferSlice> slices;
    gpu::BufferSlice constants;
    std::vector<std::byte> push;
    bool pushes_address = false;
    gpu::Groups groups;
  };

  // Layers of equal shape share a kernel.
  struct CachedKernel {
    std::string shader;
    std::vector<gpu::SpecConstant> spec_constants;
    std::unique_ptr<gpu::Kernel> kernel;
  };

  explicit Executor(std::shared_ptr<gpu::Device> device) : device_(std::move(device)) {}
  Status Upload(const DispatchPlan& plan, std::vector<gpu::BufferSlice>& constants);
  Status PlaceTensors(const DispatchPlan& plan, const ExecutorOptions& options);
  Result<const gpu::Kernel*> FindKernel(const DispatchInfo& dispatch);

  std::shared_ptr<gpu::Device> device_;
  std::unique_ptr<gpu::Buffer> weights_, arena_;
  std::vector<std::unique_ptr<gpu::Buffer>> own_buffers_;
  std::vector<gpu::BufferSlice> tensors_;
  std::vector<CachedKernel> kernels_;
  std::vector<Step> steps_;
};

}  // namespace plumb::nn
