// CPU twins: what every kernel computes, as plain loops over planar fp32 tensors.
#pragma once

#include <span>
#include <vector>

#include "plumb/nn/layer_plan.h"

namespace plumb::nn::reference {

/// One activation, planar [channels][height][width].
using Plane = std::vector<float>;

/// Computes one layer of a plan; sums in double. `features` holds at least the layer's inputs.
/// Defines all kernels of the families; see Layer for the formula.
Plane RunLayer(const LayerPlan& plan, const Layer& layer, std::span<const Plane> features);

/// Runs the whole plan. @param image [3][H][W]. @return [6][H/4][W/4].
Plane RunPlan(const LayerPlan& plan, const Plane& image);

/// The activations of all features after RunPlan, for tests that compare layer by layer.
std::vector<Plane> RunPlanKeepingAll(const LayerPlan& plan, const Plane& image);

}  // namespace plumb::nn::reference
