// Procedural surface colours.
#pragma once

#include <Eigen/Core>

#include "tools/synth/scene.h"

namespace plumb::synth {

/// Linear colour of `material` at (u, v) [m] on its surface.
Eigen::Vector3f ColourAt(const Material& material, double u, double v);

}  // namespace plumb::synth
