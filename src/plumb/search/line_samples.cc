#include "plumb/search/line_samples.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr double kStepPx = 40.0;
constexpr int kMaxSamplesPerLine = 4;
// A prior that is a little off must not lose the lines at the border.
constexpr double kMarginPx = 100.0;

std::array<std::vector<float>*, 7> ColumnsOf(LineSamples* samples) {
  return {&samples->x,           &samples->y,           &samples->z,     &samples->direction_x,
          &samples->direction_y, &samples->direction_z, &samples->weight};
}

/// Scales the weights and pads.
void Finish(double total_weight, LineSamples* samples) {
  samples->count = samples->weight.size();
  if (total_weight > 0.0) {
    for (float& weight : samples->weight) weight /= static_cast<float>(total_weight);
  }
  constexpr float kPadding[] = {0.0f, 0.0f, 1.0f, 1.0f, 0.0f, 0.0f, 0.0f};
  const std::array<std::vector<float>*, 7> columns = ColumnsOf(samples);
  while (samples->weight.size() % LineSamples::kLanes != 0) {
    for (size_t c = 0; c < columns.size(); ++c) columns[c]->push_back(kPadding[c]);
  }
}

}  // namespace

void SampleLines(const Camera& camera, const Rigid3& cam_from_world,
                 std::span<const SearchLine> lines, LineSamples* out) {
  const std::array<std::vector<float>*, 7> columns = ColumnsOf(out);
  for (std::vector<float>* column : columns) column->clear();
  double total = 0.0;
  for (const SearchLine& line : lines) {
    const Segment3 segment{cam_from_world * line.segment_in_world.start,
                           cam_from_world * line.segment_in_world.end};
    const auto image = ProjectSegmentInCam(camera, segment, kMarginPx);
    if (!image) continue;
    const double length = image->Length();
    const int samples =
        std::clamp(static_cast<int>(std::lround(length / kStepPx)), 1, kMaxSamplesPerLine);
    const Eigen::Vector3d delta = segment.Delta();
    const Eigen::Vector3f direction = delta.normalized().cast<float>();
    const double weight = line.weight * std::min(length, kStepPx * kMaxSamplesPerLine) / samples;
    for (int k = 0; k < samples; ++k) {
      const Eigen::Vector3f point =
          (segment.start + (k + 0.5) / samples * delta).template cast<float>();
      const float values[] = {point.x(),     point.y(),     point.z(),    direction.x(),
                              direction.y(), direction.z(), float(weight)};
      for (size_t c = 0; c < 7; ++c) columns[c]->push_back(values[c]);
      total += weight;
    }
  }
  Finish(total, out);
}

void TakeEvery(const LineSamples& samples, size_t stride, LineSamples* out) {
  const std::array<const std::vector<float>*, 7> in = {
      &samples.x,           &samples.y,           &samples.z,     &samples.direction_x,
      &samples.direction_y, &samples.direction_z, &samples.weight};
  const std::array<std::vector<float>*, 7> columns = ColumnsOf(out);
  for (std::vector<float>* column : columns) column->clear();
  double total = 0.0;
  for (size_t k = stride / 2; k < samples.count; k += stride) {
    for (size_t c = 0; c < columns.size(); ++c) columns[c]->push_back((*in[c])[k]);
    total += static_cast<double>(samples.weight[k]);
  }
  Finish(total, out);
}

}  // namespace plumb
