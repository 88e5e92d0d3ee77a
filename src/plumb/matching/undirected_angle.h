// Orientation of a line without direction.
#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>

namespace plumb {

/// @return angle of `delta` or -delta, whichever is in [0, pi); below pi also after rounding.
inline float UndirectedAngle(const Eigen::Vector2d& delta) {
  double angle = std::atan2(delta.y(), delta.x());
  if (angle < 0.0) angle += std::numbers::pi;
  const auto rounded = static_cast<float>(angle);
  return rounded < std::numbers::pi_v<float> ? rounded : 0.0f;
}

}  // namespace plumb
