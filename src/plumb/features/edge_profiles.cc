#include "plumb/features/edge_profiles.h"

#include <cmath>
#include <optional>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

// Four neighbours of one row's positions, mixed.
[[gnu::always_inline]] inline void Gather(const float* image, int stride, const int* index,
                                          const float* fraction_x, const float* fraction_y,
                                          int count, float* out) {
  for (int i = 0; i < count; ++i) {
    const float* p = image + index[i];
    const float top = p[0] + fraction_x[i] * (p[1] - p[0]);
    const float bottom = p[stride] + fraction_x[i] * (p[stride + 1] - p[stride]);
    out[i] = top + fraction_y[i] * (bottom - top);
  }
}

// Bilinear samples; positions outside the image take the border's value.
PLUMB_SIMD_CLONES
void SampleRows(const float* image, int stride, float max_x, float max_y, float x0, float y0,
                float dx, float dy, float nx, float ny, int num_rows, int num_profiles,
                float* out) {
  const float scale = 1.0f / static_cast<float>(num_profiles);
  alignas(64) int index[kMaxProfiles];
  alignas(64) float fraction_x[kMaxProfiles], fraction_y[kMaxProfiles];
  const float first_offset =
      -static_cast<float>(kProfileStepPx) * 0.5f * static_cast<float>(num_rows - 1);
  for (int row = 0; row < num_rows; ++row, out += kMaxProfiles) {
    const float offset =
        first_offset + static_cast<float>(kProfileStepPx) * static_cast<float>(row);
    const float start_x = x0 + offset * nx, start_y = y0 + offset * ny;
    for (int i = 0; i < num_profiles; ++i) {
      const float u = (static_cast<float>(i) + 0.5f) * scale;
      float x = start_x + u * dx, y = start_y + u * dy;
      x = x < 0.0f ? 0.0f : x;
      x = x > max_x ? max_x : x;
      y = y < 0.0f ? 0.0f : y;
      y = y > max_y ? max_y : y;
      const int ix = static_cast<int>(x), iy = static_cast<int>(y);
      index[i] = iy * stride + ix;
      fraction_x[i] = x - static_cast<float>(ix);
      fraction_y[i] = y - static_cast<float>(iy);
    }
    Gather(image, stride, index, fraction_x, fraction_y, num_profiles, out);
  }
}

// The places where profiles cross a curve, and their directions.
struct Crossings {
  alignas(64) float x[kMaxProfiles], y[kMaxProfiles];
  alignas(64) float nx[kMaxProfiles], ny[kMaxProfiles];
};

PLUMB_SIMD_CLONES
void SampleRowsAcross(const float* image, int stride, float max_x, float max_y,
                      const Crossings& crossings, int num_rows, int num_profiles, float* out) {
  alignas(64) int index[kMaxProfiles];
  alignas(64) float fraction_x[kMaxProfiles], fraction_y[kMaxProfiles];
  const float first_offset =
      -static_cast<float>(kProfileStepPx) * 0.5f * static_cast<float>(num_rows - 1);
  for (int row = 0; row < num_rows; ++row, out += kMaxProfiles) {
    const float offset =
        first_offset + static_cast<float>(kProfileStepPx) * static_cast<float>(row);
    for (int i = 0; i < num_profiles; ++i) {
      float x = crossings.x[i] + offset * crossings.nx[i];
      float y = crossings.y[i] + offset * crossings.ny[i];
      x = x < 0.0f ? 0.0f : x;
      x = x > max_x ? max_x : x;
      y = y < 0.0f ? 0.0f : y;
      y = y > max_y ? max_y : y;
      const int ix = static_cast<int>(x), iy = static_cast<int>(y);
      index[i] = iy * stride + ix;
      fraction_x[i] = x - static_cast<float>(ix);
      fraction_y[i] = y - static_cast<float>(iy);
    }
    Gather(image, stride, index, fraction_x, fraction_y, num_profiles, out);
  }
}

// Where the image of a straight segment of the ideal image is crossed at right angles.
bool FindCrossings(const Rectifier& rectifier, const Segment2& segment, int num_profiles,
                   Crossings* out, float* out_stretch) {
  const Eigen::Vector2d delta = segment.Delta();
  const Eigen::Vector2d unit = delta / delta.norm();
  for (int i = 0; i < num_profiles; ++i) {
    const double u = (i + 0.5) / num_profiles;
    const std::optional<ImagePoint> at = rectifier.ToImage(segment.start + u * delta);
    if (!at) return false;
    const Eigen::Vector2d tangent = at->jacobian * unit;
    const double length = tangent.norm();
    out->x[i] = static_cast<float>(at->px.x());
    out->y[i] = static_cast<float>(at->px.y());
    out->nx[i] = static_cast<float>(-tangent.y() / length);
    out->ny[i] = static_cast<float>(tangent.x() / length);
    out_stretch[i] = static_cast<float>(at->StretchAcross(unit));
  }
  return true;
}

}  // namespace

bool SampleProfiles(const BlurredImage& image, const Rectifier* rectifier, const Segment2& segment,
                    double half_width_px, int num_profiles, EdgeProfiles* out) {
  out->num_profiles = num_profiles;
  out->num_derivatives = 2 * static_cast<int>(std::lround(half_width_px / kProfileStepPx)) + 1;
  const float max_x = static_cast<float>(image.width_px() - 1);
  const float max_y = static_cast<float>(image.height_px() - 1);
  if (rectifier == nullptr) {
    const Eigen::Vector2d delta = segment.Delta();
    const Eigen::Vector2d unit = delta / delta.norm();
    SampleRows(image.data(), image.stride(), max_x, max_y, static_cast<float>(segment.start.x()),
               static_cast<float>(segment.start.y()), static_cast<float>(delta.x()),
               static_cast<float>(delta.y()), static_cast<float>(-unit.y()),
               static_cast<float>(unit.x()), out->num_derivatives + 2, num_profiles,
               &out->sample[0][0]);
    for (int i = 0; i < num_profiles; ++i) out->stretch[i] = 1.0f;
  } else {
    Crossings crossings;
    if (!FindCrossings(*rectifier, segment, num_profiles, &crossings, out->stretch)) return false;
    SampleRowsAcross(image.data(), image.stride(), max_x, max_y, crossings,
                     out->num_derivatives + 2, num_profiles, &out->sample[0][0]);
  }
  for (int k = 0; k < out->num_derivatives; ++k) {
    for (int i = 0; i < num_profiles; ++i) {
      out->derivative[k][i] = out->sample[k + 2][i] - out->sample[k][i];
    }
  }
  return true;
}

}  // namespace plumb
