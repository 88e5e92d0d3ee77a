// Score of a pose on a direction field: the share of the lines that lie on like-oriented segments.
#pragma once

#include <array>

#include "plumb/geometry/camera.h"
#include "plumb/search/direction_field.h"
#include "plumb/search/field_lookup.h"
#include "plumb/search/line_samples.h"

namespace plumb {

/// With r the field's distance at a sample and q = 1 / (1 + (r / sigma)^2)^2:
///
///   score = sum(w q over samples inside) / (0.8 sum(w inside) + 0.2 sum(w)), 0..1
///
/// The denominator keeps poses from winning by pushing lines out of the image.
/// Source: docs/method/association.md. Owns its work space; not thread-safe.
class FieldScorer {
 public:
  /// Chooses the field, which is borrowed, and sigma [px] for the scores that follow.
  void Prepare(const Camera& camera, const DirectionField& field, double sigma_px);
  float Score(const RelativePose& pose, const LineSamples& samples);

 private:
  Camera camera_;
  const DirectionField* field_ = nullptr;
  std::array<float, 256> similarity_{};  // q of every byte
  FieldLookups lookups_;
};

}  // namespace plumb
