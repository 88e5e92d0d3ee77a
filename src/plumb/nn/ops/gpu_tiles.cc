// Packs weights for shaders/nn/tile_*.comp.
#include "plumb/nn/ops/gpu_tiles.h"

namespace plumb::nn {
namespace {

constexpr uint32_t kTilePixels = 64;
constexpr uint32_t kDepth = 16;  // Inputs per step of the kernel.

uint32_t CeilDiv(uint32_t value, uint32_t by) { return (value + by - 1) / by; }

Operand Input(int tensor) {
  return {.tensor = tensor, .kind = gpu::BindingKind::kStorage, .access = gpu::Access::kRead};
}

Operand Output(int tensor) {
  return {.tensor = tensor, .kind = gpu::BindingKind::kStorage, .access = gpu::Access::kWrite};
}

DispatchInfo MaxPool(const LayerPlan& plan, const Layer& layer) {
  const Feature& out = plan.features[layer.output];
  const auto count = static_cast<uint32_t>(out.channels * out.height * out.width);
  DispatchInfo dispatch;
  dispatch.name = layer.name;
  dispatch.shader = "nn/tile_max_pool";
  dispatch.operands = {Input(layer.input), Output(layer.output)};
  dispatch.push = {count, static_cast<uint32_t>(out.width)};
  dispatch.groups = {CeilDiv(count, 64), 1, 1};
  return dispatch;
}

DispatchInfo Conv(const LayerPlan& plan, const Layer& layer) {
  const Feature& in = plan.features[layer.input];
  const Feature& out = plan.features[layer.output];
  const auto outputs = static_cast<uint32_t>(out.channels);
  const uint32_t extra =
      layer.extra_input >= 0 ? static_cast<uint32_t>(plan.features[layer.extra_input].channels) : 0;
  const uint32_t depth = static_cast<uint32_t>(layer.weights.size()) / outputs;
  const uint32_t out_per_thread = outputs > 32 ? 8 : 4;
  const uint32_t tile = 8 * out_per_thread;
  const uint32_t padded = CeilDiv(outputs, tile) * tile;

  DispatchInfo dispatch;
  dispatch.name = layer.name;
  dispatch.shader = "nn/tile_conv";
  const uint32_t spec[] = {static_cast<uint32_t>(layer.taps),
                           static_cast<uint32_t>(in.channels),
                           extra,
                           outputs,
                           out_per_thread,
                           !layer.prologue_scale.empty(),
                           layer.relu,
                           layer.residual >= 0,
                           layer.upsampled >= 0};
  for (uint32_t id = 0; id < std::size(spec); ++id) {
    dispatch.spec_constants.push_back(gpu::SpecConstant::Uint(id, spec[id]));
  }
  const auto or_input = [&layer](int feature) {
    return Input(feature >= 0 ? feature : layer.input);
  };
  dispatch.operands = {Input(Operand::kConstants),  Input(layer.input),
                       or_input(layer.extra_input), or_input(layer.residual),
                       or_input(layer.upsampled),   Output(layer.output)};
  dispatch.push = {static_cast<uint32_t>(in.height), static_cast<uint32_t>(in.width),
                   static_cast<uint32_t>(out.height), static_cast<uint32_t>(out.width)};
  dispatch.groups = {CeilDiv(static_cast<uint32_t>(out.height * out.width), kTilePixels),
                     padded / tile, 1};

  std::vector<float>& packed = dispatch.constants;
  const size_t bias_at = static_cast<size_t>(CeilDiv(depth, kDepth)) * kDepth * padded;
  packed.assign(bias_at + padded, 0.0f);
  for (uint32_t o = 0; o < outputs; ++o) {
    for (uint32_t k = 0; k < depth; ++k) {
      packed[static_cast<size_t>(k) * padded + o] =
          layer.weights[static_cast<size_t>(o) * depth + k];
    }
    packed[bias_at + o] = layer.bias[o];
  }
  packed.insert(packed.end(), layer.prologue_scale.begin(), layer.prologue_scale.end());
  packed.insert(packed.end(), layer.prologue_shift.begin(), layer.prologue_shift.end());
  return dispatch;
}

}  // namespace

DispatchPlan PlanGpuTiles(const LayerPlan& plan) {
  static_assert(static_cast<int>(Taps::k1x1) == 0 && static_cast<int>(Taps::k3x3) == 1 &&
                static_cast<int>(Taps::kCross7) == 2 && static_cast<int>(Taps::k7x7S2) == 3);
  DispatchPlan result;
  for (const Feature& feature : plan.features) {
    result.tensor_bytes.push_back(static_cast<size_t>(feature.channels) * feature.height *
                                  feature.width * sizeof(float));
  }
  for (const Layer& layer : plan.layers) {
    result.dispatches.push_back(layer.kind == LayerKind::kMaxPool2 ? MaxPool(plan, layer)
                                                                   : Conv(plan, layer));
  }
  return result;
}

}  // namespace plumb::nn
