// Kernel family cpu-simd: fp32 in blocks of 8 pixels, for Vulkan drivers that run on the CPU.
#pragma once

#include <span>
#include <vector>

#include "plumb/gpu/device_info.h"
#include "plumb/nn/layer_plan.h"
#include "plumb/nn/ops/dispatch_plan.h"

namespace plumb::nn {

/// Where the kernels get their weights from.
enum class WeightSource {
  kTexels,   ///< Fastest on Mesa up to 22.3.
  kAddress,  ///< Fastest on Mesa 23.2 and later, where texel fetches became function calls.
};

struct CpuSimdOptions {
  WeightSource weights = WeightSource::kTexels;
  bool winograd = true;  ///< 3x3 by F(4x4, 3x3) instead of directly.
};

/// Options for a device by its driver version.
CpuSimdOptions ChooseCpuSimdOptions(const gpu::DeviceInfo& device);

/// Empty if the device can run the family, otherwise what it lacks.
std::string MissingForCpuSimd(const gpu::DeviceInfo& device);

/// Dispatches of a layer plan. The plan's input and output are planar, all else in the layout p8:
/// [row][block of 8 columns][channel][8], rows padded with zeros, buffers to whole groups of 4 rows
/// and of 8 blocks.
DispatchPlan PlanCpuSimd(const LayerPlan& plan, const CpuSimdOptions& options);

/// Floats of a feature in the layout p8.
size_t P8Size(const Feature& feature);

/// Layout conversions, for tests and tools.
std::vector<float> PlanarToP8(const Feature& feature, std::span<const float> planar);
std::vector<float> P8ToPlanar(const Feature& feature, std::span<const float> p8);

}  // namespace plumb::nn
