// Refuses inputs that would turn into silent nonsense: NaN poses, empty cameras, wild segments.
#pragma once

#include "plumb/base/result.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// @return kInvalidArgument with one sentence that names the value and, in lists, its position.
Status CheckRefineInput(const RefineInput& input);

/// The part of it that a prior's gravity takes.
Status CheckGravity(const GravityPrior& gravity);

}  // namespace plumb
