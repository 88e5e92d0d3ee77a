// Refuses inputs that would turn into silent nonsense: NaN poses, empty cameras, wild segments.
#pragma once

#include <span>

#include "plumb/base/result.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// A prior this uncertain is no prior; a tighter one than kMinSigma would divide by zero.
inline constexpr double kMinSigma = 1e-9, kMaxPositionSigmaM = 1e3, kMaxRotationSigmaRad = 3.2;

/// @return kInvalidArgument with one sentence that names the value and, in lists, its position.
Status CheckRefineInput(const RefineInput& input);

/// Its parts that do not depend on what was detected: of `prior` and `more_priors`, ..
Status CheckPriors(const PosePrior& prior, std::span<const PosePrior> more_priors);
/// .. and of points, before the lens is taken out of them as well as after.
Status CheckPoints(std::span<const PointMatch> points);

}  // namespace plumb
