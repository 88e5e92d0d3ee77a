#include "plumb/search/line_samples.h"

#include <algorithm>
#include <cmath>

#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr double kStepPx = 40.0;
// A prior that is a little off must not lose the lines at the border.
constexpr double kMarginPx = 100.0;

/// Scales the weights and puts the lines into groups.
void Finish(double total_weight, LineSamples* samples) {
  samples->count = 0;
  LineSamples::Columns& to = samples->columns;
  for (std::vector<float>* column :
       {&to.x, &to.y, &to.z, &to.step_x, &to.step_y, &to.step_z, &to.weight}) {
    column->clear();
  }
  samples->group_samples.clear();
  samples->num_slots = 0;
  const auto append = [&](const SampledLine& line) {
    to.x.push_back(line.first.x());
    to.y.push_back(line.first.y());
    to.z.push_back(line.first.z());
    to.step_x.push_back(line.step.x());
    to.step_y.push_back(line.step.y());
    to.step_z.push_back(line.step.z());
    to.weight.push_back(line.weight);
  };
  const float scale = total_weight > 0.0 ? static_cast<float>(1.0 / total_weight) : 1.0f;
  for (SampledLine& line : samples->lines) {
    line.weight *= scale;
    samples->count += line.num_samples;
  }
  for (uint32_t num = 1; num <= LineSamples::kMaxSamples; ++num) {
    for (const SampledLine& line : samples->lines) {
      if (line.num_samples == num) append(line);
    }
    while (to.weight.size() % LineSamples::kLanes != 0) append(SampledLine{});
    while (samples->group_samples.size() * LineSamples::kLanes < to.weight.size()) {
      samples->group_samples.push_back(num);
      samples->num_slots += num * LineSamples::kLanes;
    }
  }
}

}  // namespace

void SampleLines(const Camera& camera, const Rigid3& cam_from_world,
                 std::span<const SearchLine> lines, LineSamples* out) {
  out->lines.clear();
  double total = 0.0;
  const Eigen::Matrix3d rotation = cam_from_world.RotationMatrix();
  const Eigen::Vector3d& translation = cam_from_world.translation;
  for (const SearchLine& line : lines) {
    const Segment3 segment{rotation * line.segment_in_world.start + translation,
                           rotation * line.segment_in_world.end + translation};
    const auto image = ProjectSegmentInCam(camera, segment, kMarginPx);
    if (!image) continue;
    const double length = image->Length();
    constexpr int kMax = LineSamples::kMaxSamples;
    const int samples = std::clamp(static_cast<int>(std::lround(length / kStepPx)), 1, kMax);
    const Eigen::Vector3d step = segment.Delta() / samples;
    const double weight = line.weight * std::min(length, kStepPx * kMax);
    out->lines.push_back({.first = (segment.start + 0.5 * step).cast<float>(),
                          .step = step.cast<float>(),
                          .weight = static_cast<float>(weight / samples),
                          .num_samples = static_cast<uint32_t>(samples)});
    total += weight;
  }
  Finish(total, out);
}

void TakeEvery(const LineSamples& samples, size_t stride, LineSamples* out) {
  out->lines.clear();
  double total = 0.0;
  size_t next = stride / 2;  // counted from the line's first sample
  for (const SampledLine& line : samples.lines) {
    if (next >= line.num_samples) {
      next -= line.num_samples;
      continue;
    }
    // Samples of one line stay together, so that they go on sharing its motion and direction.
    const size_t count = (line.num_samples - next + stride - 1) / stride;
    out->lines.push_back({.first = line.first + static_cast<float>(next) * line.step,
                          .step = static_cast<float>(stride) * line.step,
                          .weight = line.weight,
                          .num_samples = static_cast<uint32_t>(count)});
    total += static_cast<double>(line.weight) * static_cast<double>(count);
    next += count * stride - line.num_samples;
  }
  Finish(total, out);
}

}  // namespace plumb
