// Luminance blurred with a Gaussian, laid out for bilinear sampling.
#pragma once

#include <cstddef>
#include <vector>

#include "plumb/features/luminance.h"

namespace plumb {

/// Float luminance (0..255) under a Gaussian of sigma 1 px, borders mirrored about the outermost
/// pixel centre. One extra column and row repeat the last ones, so that the four neighbours of any
/// position inside [0, width - 1] x [0, height - 1] exist. Owns its memory and keeps it.
class BlurredImage {
 public:
  /// `gray` has 1..16384 pixels a side.
  void Assign(const GrayView& gray);

  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }
  int stride() const { return width_px_ + 1; }
  const float* data() const { return pixels_.data(); }
  float At(int x, int y) const {
    return pixels_[static_cast<size_t>(y) * static_cast<size_t>(stride()) + static_cast<size_t>(x)];
  }

 private:
  int width_px_ = 0, height_px_ = 0;
  std::vector<float> pixels_;  // (height + 1) x (width + 1)
  std::vector<float> rows_;    // the last kTaps rows, blurred horizontally
  std::vector<float> padded_;  // one row with its mirrored borders
};

}  // namespace plumb
