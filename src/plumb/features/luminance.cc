#include "plumb/features/luminance.h"

#include <cstddef>

namespace plumb {

GrayView Luminance(const ImageView& image, std::vector<uint8_t>* buffer) {
  const ImageView::Plane& plane = image.planes[0];
  const bool is_rgb = image.format == PixelFormat::kRgb8;
  if (!is_rgb && image.format != PixelFormat::kBgr8) {
    return {plane.data, plane.row_stride_bytes, image.width_px, image.height_px};
  }
  const int width = image.width_px;
  buffer->resize(static_cast<size_t>(width) * static_cast<size_t>(image.height_px));
  const int red = is_rgb ? 0 : 2, blue = is_rgb ? 2 : 0;
  for (int y = 0; y < image.height_px; ++y) {
    const uint8_t* in = plane.data + y * plane.row_stride_bytes;
    uint8_t* out = buffer->data() + static_cast<ptrdiff_t>(y) * width;
    for (int x = 0; x < width; ++x, in += 3) {
      // BT.601 in 16-bit fixed point; the three factors sum to 2^16, so white stays 255.
      const int sum = 19595 * in[red] + 38470 * in[1] + 7471 * in[blue];
      out[x] = static_cast<uint8_t>((sum + 32768) >> 16);
    }
  }
  return {buffer->data(), width, width, image.height_px};
}

}  // namespace plumb
