// Chooses the kernel family and ties layer plan, dispatch plan and executor together.
#include "plumb/nn/network.h"

#include <utility>

#include "plumb/nn/executor.h"
#include "plumb/nn/layer_plan.h"
#include "plumb/nn/ops/cpu_simd.h"
#include "plumb/nn/ops/gpu_tiles.h"

namespace plumb::nn {

struct Network::Impl {
  NetworkInfo info;
  int input = 0, output = 0;  // Tensors.
  std::unique_ptr<Executor> executor;
};

Result<std::unique_ptr<Network>> Network::Create(std::shared_ptr<gpu::Device> device,
                                                 const Model& model,
                                                 const NetworkOptions& options) {
  auto impl = std::make_unique<Impl>();
  NetworkInfo& info = impl->info;
  info.input_width = options.input_width > 0 ? options.input_width : model.spec.input_width;
  info.input_height = options.input_height > 0 ? options.input_height : model.spec.input_height;
  if (const Status size = ValidateInputSize(info.input_width, info.input_height); !size) {
    return size.error();
  }
  info.output_width = info.input_width / model.spec.stride;
  info.output_height = info.input_height / model.spec.stride;

  const gpu::DeviceInfo& device_info = device->Info();
  const std::string missing = MissingForCpuSimd(device_info);
  info.family = options.family;
  if (info.family == KernelFamily::kAuto) {
    const bool simd = device_info.IsLavapipe() && missing.empty();
    info.family = simd ? KernelFamily::kCpuSimd : KernelFamily::kGpu;
  }
  if (info.family == KernelFamily::kCpuSimd && !missing.empty()) {
    return Error{ErrorCode::kUnsupported,
                 "kernel family cpu-simd: " + device_info.name + " has " + missing};
  }
  const LayerPlan layers = BuildLayerPlan(model, info.input_width, info.input_height);
  info.gmac = CountMacs(layers) * 1e-9;
  impl->input = layers.input;
  impl->output = layers.output;
  const DispatchPlan plan = info.family == KernelFamily::kCpuSimd
                                ? PlanCpuSimd(layers, ChooseCpuSimdOptions(device_info))
                                : PlanGpuTiles(layers);
  const ExecutorOptions executor_options{.own_buffers = {layers.input, layers.output}};
  auto executor = Executor::Create(std::move(device), plan, executor_options);
  if (!executor) return executor.error();
  impl->executor = *std::move(executor);
  info.num_dispatches = impl->executor->NumDispatches();
  info.weight_bytes = impl->executor->WeightBytes();
  info.activation_bytes = impl->executor->ActivationBytes();
  return std::unique_ptr<Network>(new Network(std::move(impl)));
}

Network::Network(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Network::~Network() = default;

const NetworkInfo& Network::info() const { return impl_->info; }

const gpu::Buffer& Network::input() const { return *impl_->executor->Tensor(impl_->input).buffer; }

const gpu::Buffer& Network::output() const {
  return *impl_->executor->Tensor(impl_->output).buffer;
}

void Network::Record(gpu::Recorder& recorder, bool stage_per_layer) const {
  impl_->executor->Record(recorder, stage_per_layer);
}

const char* ToString(KernelFamily family) {
  switch (family) {
    case KernelFamily::kAuto:
      return "auto";
    case KernelFamily::kCpuSimd:
      return "cpu-simd";
    case KernelFamily::kGpu:
      break;
  }
  return "gpu";
}

}  // namespace plumb::nn
