// Plain loops; clarity before speed.
#include "plumb/nn/reference/layer_reference.h"

#include <algorithm>

namespace plumb::nn::reference {
namespace {

// The layer's input after prologue and concatenation, [in][height][width].
Plane GatherInput(const LayerPlan& plan, const Layer& layer, std::span<const Plane> features) {
  Plane input = features[layer.input];
  const Feature& shape = plan.features[layer.input];
  const size_t pixels = static_cast<size_t>(shape.height) * shape.width;
  for (size_t c = 0; c < layer.prologue_scale.size(); ++c) {
    for (size_t p = 0; p < pixels; ++p) {
      float& x = input[c * pixels + p];
      x = std::max(0.0f, layer.prologue_scale[c] * x + layer.prologue_shift[c]);
    }
  }
  if (layer.extra_input >= 0) {
    const Plane& extra = features[layer.extra_input];
    input.insert(input.end(), extra.begin(), extra.end());
  }
  return input;
}

Plane RunConv(const LayerPlan& plan, const Layer& layer, std::span<const Plane> features) {
  const Plane input = GatherInput(plan, layer, features);
  const Feature& in = plan.features[layer.input];
  const Feature& out = plan.features[layer.output];
  const size_t in_pixels = static_cast<size_t>(in.height) * in.width;
  const size_t out_pixels = static_cast<size_t>(out.height) * out.width;
  const size_t in_channels = input.size() / in_pixels;
  const auto offsets = TapOffsets(layer.taps);
  const int stride = layer.taps == Taps::k7x7S2 ? 2 : 1;
  Plane output(out_pixels * out.channels);
  std::vector<double> sums(out_pixels);
  for (int o = 0; o < out.channels; ++o) {
    std::fill(sums.begin(), sums.end(), static_cast<double>(layer.bias[o]));
    for (size_t t = 0; t < offsets.size(); ++t) {
      const auto [dy, dx] = offsets[t];
      for (size_t i = 0; i < in_channels; ++i) {
        const double weight = layer.weights[(o * offsets.size() + t) * in_channels + i];
        for (int y = 0; y < out.height; ++y) {
          const int row = y * stride + dy;
          if (row < 0 || row >= in.height) continue;
          const float* line = &input[i * in_pixels + static_cast<size_t>(row) * in.width];
          for (int x = 0; x < out.width; ++x) {
            const int column = x * stride + dx;
            if (column < 0 || column >= in.width) continue;
            sums[static_cast<size_t>(y) * out.width + x] += weight * line[column];
          }
        }
      }
    }
    for (size_t p = 0; p < out_pixels; ++p) {
      double value = layer.relu ? std::max(0.0, sums[p]) : sums[p];
      if (layer.residual >= 0) value += features[layer.residual][o * out_pixels + p];
      if (layer.upsampled >= 0) {
        const size_t y = p / out.width / 2, x = p % out.width / 2;
        value += features[layer.upsampled][o * (out_pixels / 4) + y * (out.width / 2) + x];
      }
      output[o * out_pixels + p] = static_cast<float>(value);
    }
  }
  return output;
}

Plane RunMaxPool(const LayerPlan& plan, const Layer& layer, std::span<const Plane> features) {
  const Plane& input = features[layer.input];
  const Feature& in = plan.features[layer.input];
  const Feature& out = plan.features[layer.output];
  Plane output;
  output.reserve(static_cast<size_t>(out.channels) * out.height * out.width);
  for (int c = 0; c < out.channels; ++c) {
    for (int y = 0; y < out.height; ++y) {
      for (int x = 0; x < out.width; ++x) {
        const float* p = &input[(static_cast<size_t>(c) * in.height + 2 * y) * in.width + 2 * x];
        output.push_back(std::max(std::max(p[0], p[1]), std::max(p[in.width], p[in.width + 1])));
      }
    }
  }
  return output;
}

}  // namespace

Plane RunLayer(const LayerPlan& plan, const Layer& layer, std::span<const Plane> features) {
  return layer.kind == LayerKind::kMaxPool2 ? RunMaxPool(plan, layer, features)
                                            : RunConv(plan, layer, features);
}

std::vector<Plane> RunPlanKeepingAll(const LayerPlan& plan, const Plane& image) {
  std::vector<Plane> features(plan.features.size());
  features[plan.input] = image;
  for (const Layer& layer : plan.layers) features[layer.output] = RunLayer(plan, layer, features);
  return features;
}

Plane RunPlan(const LayerPlan& plan, const Plane& image) {
  return RunPlanKeepingAll(plan, image)[plan.output];
}

}  // namespace plumb::nn::reference
