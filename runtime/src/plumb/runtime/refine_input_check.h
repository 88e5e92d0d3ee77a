// Refuses inputs that would turn into silent nonsense: NaN poses, empty cameras, wild segments.
#pragma once

#include "plumb/base/result.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// @return kInvalidArgument with one sentence that names the value and, in lists, its position.
Status CheckRefineInput(const RefineInput& input);

}  // namespace plumb
