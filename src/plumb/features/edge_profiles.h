// Derivatives of the image across a segment, along which edges are looked for.
#pragma once

#include "plumb/features/blurred_image.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/segment.h"

namespace plumb {

inline constexpr double kProfileStepPx = 0.5;  // between samples of a profile
inline constexpr int kMaxProfiles = 32;        // along a segment; they are summed in lanes of 8
inline constexpr int kMaxDerivatives = 17;     // half width 4 px

/// Derivatives across a segment, [offset][profile]: the inner loops run along the segment, over
/// contiguous memory and without dependences, which is what vectorises.
struct EdgeProfiles {
  static constexpr int kMaxSamples = kMaxDerivatives + 2;  // one step further on both sides

  int num_profiles = 0;     // multiple of 8
  int num_derivatives = 0;  // at offsets OffsetPx(i), in pixels of the image
  alignas(64) float derivative[kMaxDerivatives][kMaxProfiles];
  alignas(64) float sample[kMaxSamples][kMaxProfiles];
  /// Pixels across the segment in its own image for one pixel across its edge in the taken image:
  /// 1 without a lens.
  alignas(64) float stretch[kMaxProfiles];

  double OffsetPx(double index) const { return (index - num_derivatives / 2) * kProfileStepPx; }
};

/// Profile i crosses the segment at (i + 0.5) / num_profiles of its length. Positions outside of
/// the image take the border's value.
///
/// @param rectifier  Null: `segment` lies in the image. Otherwise in the ideal image, and profiles
///                   cross the curve that it is in the taken one.
/// @param half_width_px  of the taken image, at most 4
/// @param num_profiles   multiple of 8, at most kMaxProfiles
/// @return false when a part of `segment` is not in the taken image's lens.
bool SampleProfiles(const BlurredImage& image, const Rectifier* rectifier, const Segment2& segment,
                    double half_width_px, int num_profiles, EdgeProfiles* out);

}  // namespace plumb
