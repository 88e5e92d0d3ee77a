// Borrowed view of a depth image, and how uncertain its depths are.
#pragma once

#include <cmath>
#include <cstdint>

#include "plumb/base/result.h"

namespace plumb {

enum class DepthFormat {
  kFloat,   // 32-bit float; 0, negative, NaN and infinite mean "no depth"
  kUint16,  // 16-bit unsigned; 0 and 65535 mean "no depth"
};

/// Depth along the optical axis (z, not the length of the ray), registered to the colour image: the
/// same size, camera and lens. Borrowed: the data must outlive the call that takes the view.
struct DepthView {
  DepthFormat format = DepthFormat::kFloat;
  const void* data = nullptr;
  int64_t row_stride_bytes = 0;
  int width_px = 0, height_px = 0;
  double metres_per_unit = 1.0;  // TUM's 16-bit files: 1 / 5000; 7-Scenes': 1 / 1000

  /// kInvalidArgument that names the first member out of range: size, data, stride, alignment of
  /// data and stride to one value, scale.
  Status Validate() const;

  /// @param x, y  Inside the image.  @return depth [m], 0 where there is none.
  float MetresAt(int x, int y) const {
    const auto* row = static_cast<const unsigned char*>(data) + y * row_stride_bytes;
    if (format == DepthFormat::kUint16) {
      const uint16_t raw = reinterpret_cast<const uint16_t*>(row)[x];
      return raw == 65535 ? 0.0f : static_cast<float>(raw * metres_per_unit);
    }
    const float raw = reinterpret_cast<const float*>(row)[x];
    return std::isfinite(raw) && raw > 0.0f ? static_cast<float>(raw * metres_per_unit) : 0.0f;
  }
};

/// Standard deviation of a lifted depth: quadratic in depth for structured light and stereo.
struct DepthNoise {
  double quadratic_per_m = 0.004;
  double constant_m = 0.003;

  double SigmaAt(double depth_m) const { return quadratic_per_m * depth_m * depth_m + constant_m; }
  /// The same of an inverse depth [1/m], to first order.
  double InverseSigmaAt(double inverse_depth) const {
    return quadratic_per_m + constant_m * inverse_depth * inverse_depth;
  }
};

}  // namespace plumb
