#include "plumb/search/field_score.h"

namespace plumb {

void FieldScorer::Prepare(const Camera& camera, const DirectionField& field, double sigma_px) {
  camera_ = camera;
  field_ = &field;
  for (size_t value = 0; value < similarity_.size(); ++value) {
    const double r = field.unit_px() * static_cast<double>(value) / sigma_px;
    const double q = 1.0 / (1.0 + r * r);
    similarity_[value] = static_cast<float>(q * q);
  }
}

float FieldScorer::Score(const RelativePose& pose, const LineSamples& samples) {
  LookUp(camera_, *field_, pose, samples, &lookups_);
  const size_t count = lookups_.size();
  const uint8_t* const bytes = field_->data();
  const int32_t* const index = lookups_.index.data();
  const float* const weight = lookups_.weight.data();
  // Four sums, so that the additions do not wait for each other.
  float support[4] = {}, inside[4] = {};
  for (size_t k = 0; k < count; k += 4) {
    for (size_t lane = 0; lane < 4; ++lane) {
      support[lane] += weight[k + lane] * similarity_[bytes[index[k + lane]]];
      inside[lane] += weight[k + lane];
    }
  }
  const float seen = (inside[0] + inside[1]) + (inside[2] + inside[3]);
  const float found = (support[0] + support[1]) + (support[2] + support[3]);
  return found / (0.8f * seen + 0.2f);
}

}  // namespace plumb
