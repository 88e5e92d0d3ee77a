// 8-bit luminance of an image in any of the camera formats.
#pragma once

#include <cstdint>
#include <vector>

#include "plumb/features/image_view.h"

namespace plumb {

/// Borrowed 8-bit grey image.
struct GrayView {
  const uint8_t* data = nullptr;
  int64_t row_stride_bytes = 0;
  int width_px = 0, height_px = 0;

  const uint8_t* Row(int y) const { return data + y * row_stride_bytes; }
};

/// The luminance of `image`, which must be valid: a view of its own first plane where the format
/// has one, otherwise 0.299 R + 0.587 G + 0.114 B, rounded, in `buffer` (resized as needed).
/// The view is good for as long as `image` and `buffer` are.
/// Source: ITU-R BT.601.
GrayView Luminance(const ImageView& image, std::vector<uint8_t>* buffer);

}  // namespace plumb
