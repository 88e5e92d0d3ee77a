// Kernel family cpu-simd: fp32 in blocks of 8 pixels, for Vulkan drivers that run on the CPU.
#pragma once

#include <string>

#include "plumb/gpu/device_info.h"
#include "plumb/nn/layer_plan.h"
#include "plumb/nn/ops/dispatch_plan.h"
#include "plumb/nn/ops/p8_layout.h"

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

/// Dispatches of a layer plan. The plan's input and output are planar, all else in the layout p8.
DispatchPlan PlanCpuSimd(const LayerPlan& plan, const CpuSimdOptions& options);

}  // namespace plumb::nn
