// The network as the literature writes it: nothing folded, nothing fused. The oracle of the fusion.
#pragma once

#include "plumb/nn/model_file.h"
#include "plumb/nn/reference/layer_reference.h"

namespace plumb::nn::reference {

/// Stem, hourglasses, heads and feedback between stacks, one operation after the other.
/// @param image [3][height][width]; height and width multiples of 64.
/// @return [6][height/4][width/4] of the last stack.
Plane RunUnfused(const Model& model, const Plane& image, int width, int height);

}  // namespace plumb::nn::reference
