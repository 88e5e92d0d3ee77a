#include "plumb/features/segment_ridge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "plumb/base/simd_clones.h"
#include "plumb/features/edge_profiles.h"

namespace plumb {
namespace {

constexpr int kRidgeProfiles = 24;  // along a segment
constexpr int kTrimProfiles = 32;   // along a segment
constexpr double kTrimHalfWidthPx = 2.0;
constexpr double kDominantSigma = 0.6;  // of the half width
constexpr int kLanes = 8;               // profiles are summed in lanes of 8

// Sum over the profiles of the derivative at offset `k`.
float SumAcross(const EdgeProfiles& profiles, int k) {
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
  int index = 0;          // offset
  float polarity = 0.0f;  // +1 or -1; 0 on a flat image
  float strength = 0.0f;  // summed over the profiles, under the Gaussian
};

// Extremum of the mean profile under a Gaussian of `sigma_px` about the segment.
DominantEdge FindDominantEdge(const EdgeProfiles& profiles, double sigma_px) {
  DominantEdge edge;
  float strongest = 0.0f;
  for (int k = 0; k < profiles.num_derivatives; ++k) {
    const double offset = profiles.OffsetPx(k) / sigma_px;
    const float value =
        SumAcross(profiles, k) * static_cast<float>(std::exp(-0.5 * offset * offset));
    if (std::abs(value) > strongest) {
      strongest = std::abs(value);
      edge = {k, value > 0.0f ? 1.0f : -1.0f, strongest};
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
void FindPeaks(const EdgeProfiles& profiles, const float* weights, Peaks* out) {
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
    out->offset_px[i] = static_cast<float>(kProfileStepPx) *
                        (static_cast<float>(k) - centre + std::clamp(shift, -1.0f, 1.0f));
    out->height[i] = b;
  }
}

// offset = at_middle + slope * (u - 0.5) for u in 0..1 along the segment, in pixels of its image.
struct RidgeLine {
  float at_middle = 0.0f, slope = 0.0f;
  float weight_before = 0.0f, weight_left = 0.0f;  // before and after the reweighting
};

PLUMB_SIMD_CLONES
RidgeLine FitRidgeLine(const Peaks& peaks, const float* stretch) {
  constexpr float kMinHeight = 1.0f, kMaxHeight = 30.0f;
  constexpr float kInverseScale = 1.0f / 0.4f;
  constexpr int kNumIterations = 4;
  alignas(64) float u[kRidgeProfiles], weight[kRidgeProfiles], current[kRidgeProfiles];
  alignas(64) float offset[kRidgeProfiles], inverse_scale[kRidgeProfiles];
  RidgeLine line;
  for (int i = 0; i < kRidgeProfiles; ++i) {
    u[i] = (static_cast<float>(i) + 0.5f) / static_cast<float>(kRidgeProfiles) - 0.5f;
    const float height = peaks.height[i] < kMaxHeight ? peaks.height[i] : kMaxHeight;
    const float inverse_stretch = 1.0f / stretch[i];
    offset[i] = peaks.offset_px[i] * stretch[i];
    inverse_scale[i] = kInverseScale * inverse_stretch;
    weight[i] = height > kMinHeight ? height * (inverse_stretch * inverse_stretch) : 0.0f;
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
        t0[l] += w * offset[i + l];
        t1[l] += wu * offset[i + l];
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
      const float r = (offset[i] - line.at_middle - line.slope * u[i]) * inverse_scale[i];
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

bool MoveToRidge(const BlurredImage& image, double half_width_px, Segment2* segment,
                 const Rectifier* rectifier) {
  // Shares of the half width, and px, of the recipe.
  constexpr double kPeakSigmaPx = 1.5;
  constexpr float kMinWeightLeft = 0.25f;
  EdgeProfiles profiles;
  if (!SampleProfiles(image, rectifier, *segment, half_width_px, kRidgeProfiles, &profiles)) {
    return false;
  }
  const DominantEdge edge = FindDominantEdge(profiles, kDominantSigma * half_width_px);
  if (edge.polarity == 0.0f) return false;

  std::array<float, kMaxDerivatives> weights{};
  for (int k = 0; k < profiles.num_derivatives; ++k) {
    const double distance = (k - edge.index) * kProfileStepPx / kPeakSigmaPx;
    weights[static_cast<size_t>(k)] =
        edge.polarity * static_cast<float>(std::exp(-0.5 * distance * distance));
  }
  Peaks peaks;
  FindPeaks(profiles, weights.data(), &peaks);
  const RidgeLine line = FitRidgeLine(peaks, profiles.stretch);
  const float limit = static_cast<float>(half_width_px) * profiles.stretch[kRidgeProfiles / 2];
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

double SharedEdgeStrength(const BlurredImage& image, const Segment2& segment,
                          const Rectifier* rectifier) {
  EdgeProfiles profiles;
  if (!SampleProfiles(image, rectifier, segment, kWideHalfWidthPx, kRidgeProfiles, &profiles)) {
    return 0.0;
  }
  const DominantEdge edge = FindDominantEdge(profiles, kDominantSigma * kWideHalfWidthPx);
  return static_cast<double>(edge.strength) / kRidgeProfiles;
}

bool FindOtherBorder(const BlurredImage& image, const Segment2& segment, Segment2* out_border,
                     const Rectifier* rectifier) {
  constexpr float kMinRatio = 0.6f, kMinDerivative = 1.5f;
  EdgeProfiles profiles;
  if (!SampleProfiles(image, rectifier, segment, kWideHalfWidthPx, kRidgeProfiles, &profiles)) {
    return false;
  }
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
  out_border->start += static_cast<double>(profiles.stretch[0]) * shift;
  out_border->end += static_cast<double>(profiles.stretch[kRidgeProfiles - 1]) * shift;
  return true;
}

bool TrimToEdge(const BlurredImage& image, Segment2* segment, const Rectifier* rectifier) {
  constexpr float kMaxOffsetPx = 0.75f, kMinDerivative = 1.5f;
  constexpr int kMaxGap = 3, kMinRun = 6;
  EdgeProfiles profiles;
  if (!SampleProfiles(image, rectifier, *segment, kTrimHalfWidthPx, kTrimProfiles, &profiles)) {
    return false;
  }
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
