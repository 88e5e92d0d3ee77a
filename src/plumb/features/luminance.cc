#include "plumb/features/luminance.h"

#include <cstddef>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

// BT.601 in 16-bit fixed point; the three factors sum to 2^16, so white stays 255.
constexpr int kRed = 19595, kGreen = 38470, kBlue = 7471;

PLUMB_SIMD_CLONES
void WeighRow(const uint8_t* in, int width, int first, int third, uint8_t* out) {
  for (int x = 0; x < width; ++x) {
    const int sum = first * in[3 * x] + kGreen * in[3 * x + 1] + third * in[3 * x + 2];
    out[x] = static_cast<uint8_t>((sum + 32768) >> 16);
  }
}

}  // namespace

GrayView Luminance(const ImageView& image, std::vector<uint8_t>* buffer) {
  const ImageView::Plane& plane = image.planes[0];
  const bool is_rgb = image.format == PixelFormat::kRgb8;
  if (!is_rgb && image.format != PixelFormat::kBgr8) {
    return {plane.data, plane.row_stride_bytes, image.width_px, image.height_px};
  }
  const int width = image.width_px;
  buffer->resize(static_cast<size_t>(width) * static_cast<size_t>(image.height_px));
  for (int y = 0; y < image.height_px; ++y) {
    WeighRow(plane.data + y * plane.row_stride_bytes, width, is_rgb ? kRed : kBlue,
             is_rgb ? kBlue : kRed, buffer->data() + static_cast<ptrdiff_t>(y) * width);
  }
  return {buffer->data(), width, width, image.height_px};
}

}  // namespace plumb
