// Runs dispatch plans on a device in tests and compares tensors.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "plumb/gpu/command_list.h"
#include "plumb/gpu/recorder.h"
#include "plumb/nn/executor.h"
#include "plumb/nn/layer_plan.h"
#include "plumb/nn/reference/layer_reference.h"
#include "support/gpu_fixture.h"

namespace plumb::nn {

/// Software drivers compile at the first submission, which takes its time on a busy machine.
inline constexpr std::chrono::minutes kCompileTimeout(9);

/// Uniform in -1..1, reproducible.
inline std::vector<float> RandomValues(size_t count, uint32_t seed) {
  std::vector<float> values(count);
  uint32_t state = seed * 2654435761u + 12345u;
  for (float& value : values) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<float>(state >> 8) * 0x1p-23f - 1.0f;
  }
  return values;
}

/// Largest difference relative to the largest reference value; infinite on NaN or another size.
inline double RelativeError(std::span<const float> a, std::span<const float> reference) {
  double difference = 0, size = 1e-30;
  if (a.size() != reference.size()) return INFINITY;
  for (size_t i = 0; i < a.size(); ++i) {
    const double d = std::abs(static_cast<double>(a[i]) - reference[i]);
    if (!(d <= difference)) difference = std::isnan(d) ? INFINITY : d;
    size = std::max(size, std::abs(static_cast<double>(reference[i])));
  }
  return difference / size;
}

inline size_t PlanarSize(const Feature& feature) {
  return static_cast<size_t>(feature.channels) * feature.height * feature.width;
}

inline std::vector<float> Concat(std::vector<float> a, const std::vector<float>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// A plan of one convolution with random weights. Feature 0 is the input; the features of the
/// optional inputs follow, the output is last. Neither input nor output is the plan's own, so that
/// families keep their inner layout, unless `planar_output`.
struct LayerCase {
  Taps taps = Taps::k1x1;
  int in = 32, out = 32, height = 8, width = 8;
  int extra = 0;
  bool prologue = false, relu = false, residual = false, upsampled = false, planar_output = false;
};

inline LayerPlan MakeLayerPlan(const LayerCase& c) {
  LayerPlan plan;
  plan.input = -1;
  plan.output = -1;
  Layer layer;
  layer.name = "layer";
  layer.taps = c.taps;
  layer.relu = c.relu;
  const auto add = [&plan](int channels, int height, int width) {
    plan.features.push_back({channels, height, width});
    return static_cast<int>(plan.features.size()) - 1;
  };
  const int stride = c.taps == Taps::k7x7S2 ? 2 : 1;
  layer.input = add(c.in, c.height * stride, c.width * stride);
  if (c.extra > 0) layer.extra_input = add(c.extra, c.height, c.width);
  if (c.residual) layer.residual = add(c.out, c.height, c.width);
  if (c.upsampled) layer.upsampled = add(c.out, c.height / 2, c.width / 2);
  layer.output = add(c.out, c.height, c.width);
  if (c.prologue) {
    layer.prologue_scale = RandomValues(c.in, 11);
    layer.prologue_shift = RandomValues(c.in, 12);
  }
  layer.weights = RandomValues(TapOffsets(c.taps).size() * (c.in + c.extra) * c.out, 13);
  layer.bias = RandomValues(c.out, 14);
  if (c.taps == Taps::k7x7S2) plan.input = layer.input;  // The image tensor is planar.
  if (c.planar_output) plan.output = layer.output;
  plan.layers.push_back(std::move(layer));
  return plan;
}

/// Random contents for every feature that no layer writes.
inline std::vector<reference::Plane> RandomInputs(const LayerPlan& plan) {
  std::vector<reference::Plane> features(plan.features.size());
  for (size_t i = 0; i < features.size(); ++i) {
    const auto writes = [i](const Layer& layer) { return layer.output == static_cast<int>(i); };
    if (std::ranges::any_of(plan.layers, writes)) continue;
    features[i] = RandomValues(PlanarSize(plan.features[i]), static_cast<uint32_t>(100 + i));
  }
  return features;
}

class PlanTest : public plumb::testing::GpuTest {
 protected:
  /// Uploads `inputs` (in the family's layout; empty ones are skipped), runs, and returns a tensor.
  std::vector<float> Run(const DispatchPlan& plan, const std::vector<std::vector<float>>& inputs,
                         int output) {
    auto executor = Executor::Create(device_, plan, {.own_buffers = {}, .shares_memory = false});
    PLUMB_EXPECT_OK(executor);
    if (!executor) return {};
    for (size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].empty()) continue;
      PLUMB_EXPECT_OK(gpu::UploadNow(device_, (*executor)->Tensor(static_cast<int>(i)),
                                     std::as_bytes(std::span(inputs[i]))));
    }
    auto recorder = gpu::Recorder::Create(device_);
    PLUMB_EXPECT_OK(recorder);
    (*executor)->Record(**recorder, false);
    auto list = (*recorder)->Finish();
    PLUMB_EXPECT_OK(list);
    if (!list) return {};
    PLUMB_EXPECT_OK((*list)->Run(kCompileTimeout));
    return Read<float>((*executor)->Tensor(output));
  }
};

}  // namespace plumb::nn
