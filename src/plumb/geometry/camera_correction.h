// A camera as it was given, and as the views that it took say it is.
#pragma once

#include "plumb/geometry/rectifier.h"

namespace plumb {

struct CameraCorrection {
  ImageCamera given, corrected;
};

/// True for the same camera written down twice: same size and lens model, intrinsics within
/// 0.01 px and coefficients within 1e-6.
bool IsSameCamera(const ImageCamera& a, const ImageCamera& b);

}  // namespace plumb
