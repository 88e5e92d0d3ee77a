// Chooses shapes and packs weights for shaders/nn/p8_*.comp.
#include "plumb/nn/ops/cpu_simd.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <limits>

#include "plumb/nn/ops/winograd.h"

namespace plumb::nn {
namespace {

constexpr int kWeightGroup = 32;                // Weights of one fetch.
constexpr uint32_t kOutsideTexel = 0x3fff0000;  // Beyond every texel buffer; reads as zero.

// Most inputs that one kernel holds on its stack; more go through partial sums.
int MaxInputs(Taps taps) {
  switch (taps) {
    case Taps::k1x1:
      return 128;
    case Taps::k3x3:
      return 64;
    default:
      return 16;
  }
}

// Transformed inputs of 16 channels, 36 KB, just stay in the first-level cache.
constexpr int kMaxWinogradInputs = 16;

const char* ShaderName(Taps taps, WeightSource source) {
  const bool address = source == WeightSource::kAddress;
  switch (taps) {
    case Taps::k1x1:
      return address ? "nn/p8_conv1x1_address" : "nn/p8_conv1x1";
    case Taps::k3x3:
      return address ? "nn/p8_conv3x3_address" : "nn/p8_conv3x3";
    default:
      return address ? "nn/p8_cross7_address" : "nn/p8_cross7";
  }
}

// Small planes have few workgroups; their output channels are split so that every thread has work.
int SplitOutputs(int groups, int channels) {
  int split = 1;
  while (groups * split < 4 && channels % (2 * split) == 0 && channels / (2 * split) >= 8)
    split *= 2;
  return split;
}

class Planner {
 public:
  Planner(const LayerPlan& layers, const CpuSimdOptions& options)
      : layers_(layers), options_(options) {}

  DispatchPlan Plan() && {
    for (size_t i = 0; i < layers_.features.size(); ++i) {
      const Feature& feature = layers_.features[i];
      const bool planar =
          static_cast<int>(i) == layers_.input || static_cast<int>(i) == layers_.output;
      const size_t floats =
          planar ? static_cast<size_t>(feature.channels) * feature.height * feature.width
                 : P8Size(feature);
      plan_.tensor_bytes.push_back(floats * sizeof(float));
    }
    for (const Layer& layer : layers_.layers) {
      if (layer.kind == LayerKind::kMaxPool2) {
        MaxPool(layer);
      } else if (layer.taps == Taps::k7x7S2) {
        Stem(layer);
      } else {
        Conv(layer);
      }
    }
    return std::move(plan_);
  }

 private:
  static Operand Constants() {
    return {.tensor = Operand::kConstants, .kind = gpu::BindingKind::kTexelRgba32F};
  }
  static Operand Texels(int tensor) {
    return {.tensor = tensor, .kind = gpu::BindingKind::kTexelRgba32F};
  }
  static Operand Output(int tensor) {
    return {.tensor = tensor, .kind = gpu::BindingKind::kStorage, .access = gpu::Access::kWrite};
  }

  const Feature& At(int feature) const { return layers_.features[feature]; }

  void MaxPool(const Layer& layer) {
    const Feature& out = At(layer.output);
    const int split = SplitOutputs(P8Groups(out), out.channels);
    DispatchInfo dispatch;
    dispatch.name = layer.name;
    dispatch.shader = "nn/p8_max_pool";
    dispatch.spec_constants = Spec({out.channels});
    dispatch.push = {static_cast<uint32_t>(out.width)};
    dispatch.operands = {Texels(layer.input), Output(layer.output)};
    dispatch.groups = {static_cast<uint32_t>(P8Groups(out)), static_cast<uint32_t>(split), 1};
    plan_.dispatches.push_back(std::move(dispatch));
  }

  void Stem(const Layer& layer) {
    const Feature& in = At(layer.input);
    const Feature& out = At(layer.output);
    constexpr int kTaps = 49, kRow = 160;
    DispatchInfo dispatch;
    dispatch.name = layer.name;
    dispatch.shader = "nn/p8_stem";
    dispatch.spec_constants = Spec({out.channels, in.height, in.width});
    dispatch.operands = {Constants(), Texels(layer.input), Output(layer.output)};
    dispatch.constants.assign(static_cast<size_t>(out.channels) * kRow, 0.0f);
    for (int o = 0; o < out.channels; ++o) {
      float* row = &dispatch.constants[static_cast<size_t>(o) * kRow];
      for (int t = 0; t < kTaps; ++t) {
        for (int i = 0; i < kInputPlanes; ++i) {
          row[i * kTaps + t] =
              layer.weights[(static_cast<size_t>(o) * kTaps + t) * kInputPlanes + i];
        }
      }
      row[kTaps * kInputPlanes] = layer.bias[o];
    }
    dispatch.groups = {static_cast<uint32_t>(P8Groups(out)), 1, 1};
    plan_.dispatches.push_back(std::move(dispatch));
  }

  // Splits the inputs of a convolution into parts that fit one kernel, and chains partial sums.
  void Conv(const Layer& layer) {
    const int in = At(layer.input).channels;
    const int total = in + (layer.extra_input >= 0 ? At(layer.extra_input).channels : 0);
    const bool winograd = layer.taps == Taps::k3x3 && options_.winograd && layer.residual < 0 &&
                          layer.upsampled < 0 && layer.prologue_scale.empty() &&
                          layer.output != layers_.output;
    const int most = winograd ? kMaxWinogradInputs : MaxInputs(layer.taps);
    const int parts = (total + most - 1) / most;
    const int step = P8RoundUp((total + parts - 1) / parts, 4);
    int partial = -1;
    for (int begin = 0; begin < total; begin += step) {
      const int end = std::min(total, begin + step);
      const bool last = end == total;
      int target = layer.output;
      if (!last) {
        target = static_cast<int>(plan_.tensor_bytes.size());
        plan_.tensor_bytes.push_back(P8Size(At(layer.output)) * sizeof(float));
      }
      if (winograd) {
        WinogradPart(layer, begin, end, partial, target);
      } else {
        ConvPart(layer, begin, end, partial, target);
      }
      partial = target;
    }
  }

  void WinogradPart(const Layer& layer, int begin, int end, int partial, int target) {
    const Feature& in = At(layer.input);
    const Feature& out = At(layer.output);
    const int groups = P8TileGroups(out);
    const int split = SplitOutputs(groups, out.channels);
    const bool last = target == layer.output;
    DispatchInfo dispatch;
    dispatch.name = layer.name;
    if (partial >= 0 || !last) dispatch.name += PartName(begin, end);
    dispatch.shader =
        options_.weights == WeightSource::kAddress ? "nn/p8_winograd_address" : "nn/p8_winograd";
    const float floor = layer.relu && last ? 0.0f : std::numeric_limits<float>::lowest();
    dispatch.spec_constants = Spec({end - begin});
    dispatch.push = {static_cast<uint32_t>(out.height),   static_cast<uint32_t>(out.width),
                     static_cast<uint32_t>(begin),        static_cast<uint32_t>(in.channels),
                     static_cast<uint32_t>(out.channels), std::bit_cast<uint32_t>(floor),
                     partial >= 0 ? 0 : kOutsideTexel};
    if (options_.weights == WeightSource::kAddress)
      dispatch.push.push_back(0);  // Aligns the address.
    dispatch.operands = {Constants(), Texels(layer.input),
                         Texels(partial >= 0 ? partial : layer.input), Output(target)};
    dispatch.constants = PackWinograd(layer, begin, end, partial < 0);
    dispatch.pushes_address = options_.weights == WeightSource::kAddress;
    dispatch.groups = {static_cast<uint32_t>(groups), static_cast<uint32_t>(split), 1};
    plan_.dispatches.push_back(std::move(dispatch));
  }

  // [out][position / 4][input][position % 4], then the bias, rows padded to whole fetches.
  std::vector<float> PackWinograd(const Layer& layer, int begin, int end, bool with_bias) const {
    const int outputs = At(layer.output).channels, total = At(layer.input).channels;
    const int inputs = end - begin;
    const int row = P8RoundUp(kWinogradPositions * inputs + 1, kWeightGroup);
    std::vector<float> packed(static_cast<size_t>(outputs) * row, 0.0f);
    for (int o = 0; o < outputs; ++o) {
      float* to = &packed[static_cast<size_t>(o) * row];
      for (int i = 0; i < inputs; ++i) {
        std::array<double, 9> kernel;
        for (int t = 0; t < 9; ++t) {
          kernel[t] = layer.weights[(static_cast<size_t>(o) * 9 + t) * total + begin + i];
        }
        const auto transformed = WinogradKernel(kernel);
        for (int p = 0; p < kWinogradPositions; ++p) {
          to[(p / 4 * inputs + i) * 4 + p % 4] = static_cast<float>(transformed[p]);
        }
      }
      to[kWinogradPositions * inputs] = with_bias ? layer.bias[o] : 0.0f;
    }
    return packed;
  }

  static std::string PartName(int begin, int end) {
    return " [" + std::to_string(begin) + "," + std::to_string(end) + ")";
  }

  // Inputs [begin, end) of the layer's concatenated inputs; `partial` is the sum of those before.
  // A residual may be added anywhere in a chain, since layers that have one have no ReLU; it takes
  // the binding of the partial sum and so goes to the first part.
  void ConvPart(const Layer& layer, int begin, int end, int partial, int target) {
    const Feature& in = At(layer.input);
    const Feature& out = At(layer.output);
    const bool first = begin == 0;
    const bool last = target == layer.output;
    const int in_first = std::min(begin, in.channels), in_end = std::min(end, in.channels);
    const int extra_total = layer.extra_input >= 0 ? At(layer.extra_input).channels : 0;
    const int extra_first = std::max(begin - in.channels, 0),
              extra_end = std::max(end - in.channels, 0);
    const int add = first ? layer.residual : partial;
    const bool relu = layer.relu && last;
    const bool upsampled = layer.upsampled >= 0 && first;
    const bool planar = target == layers_.output;
    const bool prologue = !layer.prologue_scale.empty() && in_end > in_first;
    const int groups = P8Groups(out);
    const int split = SplitOutputs(groups, out.channels);

    DispatchInfo dispatch;
    dispatch.name = layer.name;
    if (!(first && last)) dispatch.name += PartName(begin, end);
    dispatch.shader = ShaderName(layer.taps, options_.weights);
    dispatch.spec_constants =
        Spec({in_end - in_first, in_first, in.channels, extra_end - extra_first, extra_first,
              extra_total, out.channels, prologue, relu, add < 0 ? 0 : (first ? 1 : 2), upsampled,
              planar});
    dispatch.push = {static_cast<uint32_t>(out.height), static_cast<uint32_t>(out.width)};
    dispatch.operands = {Constants(),
                         Texels(layer.input),
                         Texels(extra_end > extra_first ? layer.extra_input : layer.input),
                         Texels(add >= 0 ? add : layer.input),
                         Texels(upsampled ? layer.upsampled : layer.input),
                         Output(target)};
    dispatch.constants =
        PackWeights(layer, begin, end, first, prologue ? in_first : 0, prologue ? in_end : 0);
    dispatch.pushes_address = options_.weights == WeightSource::kAddress;
    dispatch.groups = {static_cast<uint32_t>(groups), static_cast<uint32_t>(split), 1};
    plan_.dispatches.push_back(std::move(dispatch));
  }

  std::vector<float> PackWeights(const Layer& layer, int begin, int end, bool with_bias,
                                 int prologue_begin, int prologue_end) const {
    const int outputs = At(layer.output).channels;
    const int taps = static_cast<int>(TapOffsets(layer.taps).size());
    const int total = static_cast<int>(layer.weights.size()) / (outputs * taps);
    const int row = P8RoundUp(taps * (end - begin) + 1, kWeightGroup);
    std::vector<float> packed(static_cast<size_t>(outputs) * row, 0.0f);
    for (int o = 0; o < outputs; ++o) {
      float* to = &packed[static_cast<size_t>(o) * row];
      for (int i = begin; i < end; ++i) {
        for (int t = 0; t < taps; ++t) {
          to[(i - begin) * taps + t] =
              layer.weights[(static_cast<size_t>(o) * taps + t) * total + i];
        }
      }
      to[taps * (end - begin)] = with_bias ? layer.bias[o] : 0.0f;
    }
    for (const std::vector<float>* values : {&layer.prologue_scale, &layer.prologue_shift}) {
      if (prologue_end <= prologue_begin) break;
      const size_t at = packed.size();
      packed.resize(at + P8RoundUp(prologue_end - prologue_begin, kWeightGroup), 0.0f);
      std::copy(values->begin() + prologue_begin, values->begin() + prologue_end,
                packed.begin() + at);
    }
    return packed;
  }

  static std::vector<gpu::SpecConstant> Spec(std::initializer_list<int> values) {
    std::vector<gpu::SpecConstant> constants;
    uint32_t id = 0;
    for (const int value : values) constants.push_back(gpu::SpecConstant::Int(id++, value));
    return constants;
  }

  const LayerPlan& layers_;
  const CpuSimdOptions options_;
  DispatchPlan plan_;
};

}  // namespace

CpuSimdOptions ChooseCpuSimdOptions(const gpu::DeviceInfo& device) {
  // driver_info reads "Mesa 22.3.6 (LLVM 15.0.6)"; other spellings count as new.
  int major = 0, minor = 0;
  const size_t at = device.driver_info.find("Mesa ");
  if (at != std::string::npos) {
    std::sscanf(device.driver_info.c_str() + at, "Mesa %d.%d", &major, &minor);
  }
  const bool old = major > 0 && (major < 23 || (major == 23 && minor < 2));
  const bool addresses = device.features.buffer_device_address && device.features.shader_int64;
  return {.weights = old || !addresses ? WeightSource::kTexels : WeightSource::kAddress};
}

std::string MissingForCpuSimd(const gpu::DeviceInfo& device) {
  if (device.subgroup_size != kP8Lanes) {
    return "subgroups of " + std::to_string(device.subgroup_size) + " instead of 8 lanes";
  }
  if (!device.subgroup_shuffle) return "no subgroup shuffle";
  if (!device.features.shader_float64) return "no shaderFloat64";
  if (!device.features.scalar_block_layout) return "no scalarBlockLayout";
  return {};
}

DispatchPlan PlanCpuSimd(const LayerPlan& plan, const CpuSimdOptions& options) {
  return Planner(plan, options).Plan();
}

}  // namespace plumb::nn
