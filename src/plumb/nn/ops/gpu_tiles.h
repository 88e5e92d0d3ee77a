// Kernel family gpu: implicit GEMM with shared-memory tiles, planar fp32, for any Vulkan device.
#pragma once

#include "plumb/nn/layer_plan.h"
#include "plumb/nn/ops/dispatch_plan.h"

namespace plumb::nn {

/// Dispatches of a layer plan; every tensor is planar [channel][row][column] fp32.
DispatchPlan PlanGpuTiles(const LayerPlan& plan);

}  // namespace plumb::nn
