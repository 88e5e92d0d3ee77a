// Coarse alignment of a pose: Gauss-Newton on the direction field.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/search/direction_field.h"
#include "plumb/search/field_lookup.h"
#include "plumb/search/line_samples.h"

namespace plumb {

struct FieldAlignmentOptions {
  double sigma_px = 12.0;  // of the robust weight
  int num_steps = 3;
  /// Prior factor around the identity, per component of the tangent vector.
  double prior_rotation_sigma_rad = 0.05, prior_position_sigma_m = 0.15;
};

/// The residual of a sample is the distance of its cell, carried from the cell's centre to the
/// sample along the gradient, the central difference of its channel; a step that hardly moves the
/// image is the last; weights w n / (1 + (r / sigma)^2)^2 / sigma^2, truncated samples left out.
/// Source: docs/method/association.md. Owns its work space; not thread-safe.
class FieldAligner {
 public:
  /// @return the pose after `num_steps`; earlier if a step cannot be solved.
  RelativePose Align(const Camera& camera, const DirectionField& field, const LineSamples& samples,
                     const RelativePose& start, const FieldAlignmentOptions& options);

 private:
  FieldLookups lookups_;
  std::vector<int32_t> center_, across_, down_;  // bytes of the field and their differences
  std::vector<float> distance_;
  std::array<std::vector<float>, 6> jacobian_;
};

}  // namespace plumb
