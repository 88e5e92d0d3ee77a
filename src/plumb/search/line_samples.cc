#include "plumb/search/line_samples.h"

#include <algorithm>
#include <cmath>

#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr double kStepPx = 40.0;
constexpr int kMaxSamplesPerLine = 4;
// A prior that is a little off must not lose the lines at the border.
constexpr double kMarginPx = 100.0;

}  // namespace

void SampleLines(const Camera& camera, const Rigid3& cam_from_world,
                 std::span<const SearchLine> lines, LineSamples* out) {
  std::vector<float>* const columns[] = {&out->x,           &out->y,           &out->z,
                                         &out->direction_x, &out->direction_y, &out->direction_z,
                                         &out->weight};
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
      for (int c = 0; c < 7; ++c) columns[c]->push_back(values[c]);
      total += weight;
    }
  }
  out->count = out->weight.size();
  if (total > 0.0) {
    for (float& weight : out->weight) weight /= static_cast<float>(total);
  }
  const float padding[] = {0.0f, 0.0f, 1.0f, 1.0f, 0.0f, 0.0f, 0.0f};
  while (out->weight.size() % LineSamples::kLanes != 0) {
    for (int c = 0; c < 7; ++c) columns[c]->push_back(padding[c]);
  }
}

}  // namespace plumb
