#include "plumb/features/segment_ridge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr double kStepPx = 0.5;        // between samples of a profile
constexpr int kRidgeProfiles = 24;     // along a segment
constexpr int kTrimProfiles = 32;      // along a segment
constexpr double kTrimHalfWidthPx = 2.0;
constexpr int kMaxProfiles = 32;
constexpr int kMaxDerivatives = 17;               // half width 4 px
constexpr int kMaxSamples = kMaxDerivatives + 2;  // one step further on both sides
constexpr int kLanes = 8;                         // profiles are summed in lanes of 8

// Derivatives across a segment, [offset][profile]: the inner loops run along the segment, over
// contiguous memory and without dependences, which is what vectorises.
struct Profiles {
  int num_profiles = 0;     // multiple of kLanes
  int num_derivatives = 0;  // at offsets (i - num_derivatives / 2) * kStepPx
  alignas(64) float derivative[kMaxDerivatives][kMaxProfiles];
  alignas(64) float sample[kMaxSamples][kMaxProfiles];

  double OffsetPx(double index) const { return (index - num_derivatives / 2) * kStepPx; }
};

// Bilinear samples; positions outside the image take the border's value.
PLUMB_SIMD_CLONES
void SampleRows(const float* image, int stride, float max_x, float max_y, float x0, float y0,
                float dx, float dy, float nx, float ny, int num_rows, int num_profiles,
                float* out) {
  const float scale = 1.0f / static_cast<float>(num_profiles);
  alignas(64) int index[kMaxProfiles];
  alignas(64) float fraction_x[kMaxProfiles], fraction_y[kMaxProfiles];
  const float first_offset =
      -static_cast<float>(kStepPx) * 0.5f * static_cast<float>(num_rows - 1);
  for (int row = 0; row < num_rows; ++row, out += kMaxProfiles) {
    const float offset = first_offset + static_cast<float>(kStepPx) * static_cast<float>(row);
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
    for (int i = 0; i < num_profiles; ++i) {
      const float* p = image + index[i];
      const float top = p[0] + fraction_x[i] * (p[1] - p[0]);
      const float bottom = p[stride] + fraction_x[i] * (p[stride + 1] - p[stride]);
      out[i] = top + fraction_y[i] * (bottom - top);
    }
  }
}

void SampleProfiles(const BlurredImage& image, const Segment2& segment, double half_width_px,
                    int num_profiles, Profiles* out) {
  const Eigen::Vector2d delta = segment.Delta();
  const Eigen::Vector2d unit = delta / delta.norm();
  out->num_profiles = num_profiles;
  out->num_derivatives = 2 * static_cast<int>(std::lround(half_width_px / kStepPx)) + 1;
  SampleRows(image.data(), image.stride(), static_cast<float>(image.width_px() - 1),
             static_cast<float>(image.height_px() - 1), static_cast<float>(segment.start.x()),
             static_cast<float>(segment.start.y()), static_cast<float>(delta.x()),
             static_cast<float>(delta.y()), static_cast<float>(-unit.y()),
             static_cast<float>(unit.x()), out->num_derivatives + 2, num_profiles,
             &out->sample[0][0]);
  for (int k = 0; k < out->num_derivatives; ++k) {
    for (int i = 0; i < num_profiles; ++i) {
      out->derivative[k][i] = out->sample[k + 2][i] - out->sample[k][i];
    }
  }
}

// Sum over the profiles of the derivative at offset `k`.
float SumAcross(const Profiles& profiles, int k) {
  float lanes[kLanes] = {};
  for (int i = 0; i < profiles.num_profiles; i += kLanes) {
    for (int l = 0; l < kLanes; ++l) lanes[l] += profiles.derivative[k][i + l];
  }
  float sum = 0.0f;
  for (const float lane : lanes) sum += lane;
  return sum;
}

// The edge that most of the profiles share.
struct DominantEdge {
  int index = 0;         // offset
  float polarity = 0.0f;  // +1 or -1; 0 on a flat image
};

// Extremum of the mean profile under a Gaussian of `sigma_px` about the segment.
DominantEdge FindDominantEdge(const Profiles& profiles, double sigma_px) {
  DominantEdge edge;
  float strongest = 0.0f;
  for (int k = 0; k < profiles.num_derivatives; ++k) {
    const double offset = profiles.OffsetPx(k) / sigma_px;
    const float value = SumAcross(profiles, k) * static_cast<float>(std::exp(-0.5 * offset * offset));
    if (std::abs(value) > strongest) {
      strongest = std::abs(value);
      edge = {k, value > 0.0f ? 1.0f : -1.0f};
    }
  }
  return edge;
}

// The strongest derivative of each profile, to a fraction of a step.
struct Peaks {
  alignas(64) float offset_px[kMaxProfiles];
  alignas(64) float height[kMaxProfiles];
};

// `weights[k]` multiplies the derivative at offset k; negative products count as zero.
PLUMB_SIMD_CLONES
void FindPeaks(const Profiles& profiles, const float* weights, Peaks* out) {
  // After this the first and last offset hold neighbours only: a peak needs both of its sides.
  alignas(64) float response[kMaxDerivatives][kMaxProfiles];
  alignas(64) float best[kMaxProfiles];
  alignas(64) int best_index[kMaxProfiles];
  const int n = profiles.num_profiles, last = profiles.num_derivatives - 1;
  for (int i = 0; i < n; ++i) {
    best[i] = -1.0f;
    best_index[i] = 0;
  }
  for (int k = 0; k <= last; ++k) {
    const float weight = weights[k];
    for (int i = 0; i < n; ++i) {
      const float product = profiles.derivative[k][i] * weight;
      const float r = product > 0.0f ? product : 0.0f;
      response[k][i] = r;
      const bool larger = r > best[i];
      best[i] = larger ? r : best[i];
      best_index[i] = larger ? k : best_index[i];
    }
  }
  const float centre = static_cast<float>(profiles.num_derivatives / 2);
  for (int i = 0; i < n; ++i) {
    const int k = std::clamp(best_index[i], 1, last - 1);
    const float a = response[k - 1][i], b = response[k][i], c = response[k + 1][i];
    // A parabola through the three; its curvature is negative at a proper peak.
    const float shift = 0.5f * (a - c) / std::min(a - 2.0f * b + c, -1e-6f);
    out->offset_px[i] = static_cast<float>(kStepPx) *
                        (static_cast<float>(k) - centre + std::clamp(shift, -1.0f, 1.0f));
    out->height[i] = b;
  }
}

// offset = at_middle + slope * (u - 0.5) for u in 0..1 along the segment.
struct RidgeLine {
  float at_middle = 0.0f, slope = 0.0f;
  float weight_before = 0.0f, weight_left = 0.0f;  // before and after the reweighting
};

PLUMB_SIMD_CLONES
RidgeLine FitRidgeLine(const Peaks& peaks) {
  constexpr float kMinHeight = 1.0f, kMaxHeight = 30.0f;
  constexpr float kInverseScale = 1.0f / 0.4f;
  constexpr int kNumIterations = 4;
  alignas(64) float u[kRidgeProfiles], weight[kRidgeProfiles], current[kRidgeProfiles];
  RidgeLine line;
  for (int i = 0; i < kRidgeProfiles; ++i) {
    u[i] = (static_cast<float>(i) + 0.5f) / static_cast<float>(kRidgeProfiles) - 0.5f;
    const float height = peaks.height[i] < kMaxHeight ? peaks.height[i] : kMaxHeight;
    weight[i] = height > kMinHeight ? height : 0.0f;
    current[i] = weight[i];
  }
  for (int iteration = 0; iteration < kNumIterations; ++iteration) {
    float s0[kLanes] = {}, s1[kLanes] = {}, s2[kLanes] = {}, t0[kLanes] = {}, t1[kLanes] = {};
    for (int i = 0; i < kRidgeProfiles; i += kLanes) {
      for (int l = 0; l < kLanes; ++l) {
        const float w = current[i + l], wu = w * u[i + l];
        s0[l] += w;
        s1[l] += wu;
        s2[l] += wu * u[i + l];
        t0[l] += w * peaks.offset_px[i + l];
        t1[l] += wu * peaks.offset_px[i + l];
      }
    }
    float sum0 = 1e-9f, sum1 = 0.0f, sum2 = 0.0f, right0 = 0.0f, right1 = 0.0f;
    for (int l = 0; l < kLanes; ++l) {
      sum0 += s0[l];
      sum1 += s1[l];
      sum2 += s2[l];
      right0 += t0[l];
      right1 += t1[l];
    }
    const float determinant = sum0 * sum2 - sum1 * sum1 + 1e-9f;
    line.at_middle = (sum2 * right0 - sum1 * right1) / determinant;
    line.slope = (sum0 * right1 - sum1 * right0) / determinant;
    for (int i = 0; i < kRidgeProfiles; ++i) {
      const float r =
          (peaks.offset_px[i] - line.at_middle - line.slope * u[i]) * kInverseScale;
      const float q = 1.0f + r * r;
      current[i] = weight[i] / (q * q);
    }
  }
  for (int i = 0; i < kRidgeProfiles; ++i) {
    line.weight_before += weight[i];
    line.weight_left += current[i];
  }
  return line;
}

}  // namespace

bool MoveToRidge(const BlurredImage& image, double half_width_px, Segment2* segment) {
  // Shares of the half width, and px, of the recipe.
  constexpr double kDominantSigma = 0.6, kPeakSigmaPx = 1.5;
  constexpr float kMinWeightLeft = 0.25f;
  Profiles profiles;
  SampleProfiles(image, *segment, half_width_px, kRidgeProfiles, &profiles);
  const DominantEdge edge = FindDominantEdge(profiles, kDominantSigma * half_width_px);
  if (edge.polarity == 0.0f) return false;

  std::array<float, kMaxDerivatives> weights{};
  for (int k = 0; k < profiles.num_derivatives; ++k) {
    const double distance = (k - edge.index) * kStepPx / kPeakSigmaPx;
    weights[static_cast<size_t>(k)] =
        edge.polarity * static_cast<float>(std::exp(-0.5 * distance * distance));
  }
  Peaks peaks;
  FindPeaks(profiles, weights.data(), &peaks);
  const RidgeLine line = FitRidgeLine(peaks);
  const float limit = static_cast<float>(half_width_px);
  if (!(std::abs(line.at_middle) < limit && std::abs(line.slope) < limit &&
        line.weight_before > 0.0f && line.weight_left > kMinWeightLeft * line.weight_before)) {
    return false;
  }
  const Eigen::Vector2d unit = segment->Delta().normalized();
  const Eigen::Vector2d normal(-unit.y(), unit.x());
  segment->start += (line.at_middle - 0.5 * line.slope) * normal;
  segment->end += (line.at_middle + 0.5 * line.slope) * normal;
  return true;
}

bool FindOtherBorder(const BlurredImage& image, const Segment2& segment, Segment2* out_border) {
  constexpr float kMinRatio = 0.6f, kMinDerivative = 1.5f;
  Profiles profiles;
  SampleProfiles(image, segment, kWideHalfWidthPx, kRidgeProfiles, &profiles);
  const float own = SumAcross(profiles, profiles.num_derivatives / 2);
  const float polarity = own > 0.0f ? -1.0f : 1.0f;
  int best = 0;
  float strongest = 0.0f;
  for (int k = 1; k < profiles.num_derivatives - 1; ++k) {
    const float strength = polarity * SumAcross(profiles, k);
    if (strength > strongest) {
      strongest = strength;
      best = k;
    }
  }
  if (strongest < kMinRatio * std::abs(own) || strongest < kMinDerivative * kRidgeProfiles) {
    return false;
  }
  const Eigen::Vector2d unit = segment.Delta().normalized();
  const Eigen::Vector2d shift = profiles.OffsetPx(best) * Eigen::Vector2d(-unit.y(), unit.x());
  *out_border = segment;
  out_border->start += shift;
  out_border->end += shift;
  return true;
}

bool TrimToEdge(const BlurredImage& image, Segment2* segment) {
  constexpr float kMaxOffsetPx = 0.75f, kMinDerivative = 1.5f;
  constexpr int kMaxGap = 3, kMinRun = 6;
  Profiles profiles;
  SampleProfiles(image, *segment, kTrimHalfWidthPx, kTrimProfiles, &profiles);
  const DominantEdge edge = FindDominantEdge(profiles, 1.0);
  if (edge.polarity == 0.0f) return false;
  std::array<float, kMaxDerivatives> weights;
  weights.fill(edge.polarity);
  Peaks peaks;
  FindPeaks(profiles, weights.data(), &peaks);

  // The longest run of good profiles [first, last], bridging gaps of up to kMaxGap bad ones.
  int num_good = 0, run_first = 0, run_good = 0, previous = -kTrimProfiles;
  int best_first = 0, best_last = -1, best_good = 0;
  for (int i = 0; i < kTrimProfiles; ++i) {
    if (!(std::abs(peaks.offset_px[i]) < kMaxOffsetPx && peaks.height[i] > kMinDerivative)) {
      continue;
    }
    ++num_good;
    if (i - previous > kMaxGap + 1) {
      run_first = i;
      run_good = 0;
    }
    previous = i;
    ++run_good;
    if (i - run_first > best_last - best_first) {
      best_first = run_first;
      best_last = i;
      best_good = run_good;
    }
  }
  if (2 * num_good <= kTrimProfiles || best_good < kMinRun) return false;
  const Eigen::Vector2d start = segment->start, delta = segment->Delta();
  segment->start = start + static_cast<double>(best_first) / kTrimProfiles * delta;
  segment->end = start + static_cast<double>(best_last + 1) / kTrimProfiles * delta;
  return true;
}

}  // namespace plumb
