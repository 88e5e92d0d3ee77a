#include "plumb/features/image_tensor_reference.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace plumb {
namespace {

using Rgb = std::array<float, 3>;

float ByteAt(const ImageView& image, size_t plane, int x, int y) {
  const ImageView::Plane& p = image.planes[plane];
  return static_cast<float>(p.data[y * p.row_stride_bytes + x]);
}

Rgb YuvToRgb(float y, float u, float v) {
  u -= 128.0f;
  v -= 128.0f;
  return {y + 1.402f * v, y - 0.344136f * u - 0.714136f * v, y + 1.772f * u};
}

// One pixel, not clamped.
Rgb PixelAt(const ImageView& image, int x, int y) {
  switch (image.format) {
    case PixelFormat::kGray8: {
      const float v = ByteAt(image, 0, x, y);
      return {v, v, v};
    }
    case PixelFormat::kRgb8:
      return {ByteAt(image, 0, 3 * x, y), ByteAt(image, 0, 3 * x + 1, y),
              ByteAt(image, 0, 3 * x + 2, y)};
    case PixelFormat::kBgr8:
      return {ByteAt(image, 0, 3 * x + 2, y), ByteAt(image, 0, 3 * x + 1, y),
              ByteAt(image, 0, 3 * x, y)};
    case PixelFormat::kNv12:
      return YuvToRgb(ByteAt(image, 0, x, y), ByteAt(image, 1, x / 2 * 2, y / 2),
                      ByteAt(image, 1, x / 2 * 2 + 1, y / 2));
    case PixelFormat::kNv21:
      return YuvToRgb(ByteAt(image, 0, x, y), ByteAt(image, 1, x / 2 * 2 + 1, y / 2),
                      ByteAt(image, 1, x / 2 * 2, y / 2));
    case PixelFormat::kI420:
      return YuvToRgb(ByteAt(image, 0, x, y), ByteAt(image, 1, x / 2, y / 2),
                      ByteAt(image, 2, x / 2, y / 2));
  }
  return {};
}

struct Tap {
  int first, second;
  float weight;  // of the second
};

Tap MakeTap(int out_pos, int out_size, int in_size) {
  const float scale = static_cast<float>(in_size) / static_cast<float>(out_size);
  const float pos = std::clamp((static_cast<float>(out_pos) + 0.5f) * scale - 0.5f, 0.0f,
                               static_cast<float>(in_size - 1));
  const int first = static_cast<int>(pos);
  return {first, std::min(first + 1, in_size - 1), pos - static_cast<float>(first)};
}

}  // namespace

std::vector<float> ImageToTensorReference(const ImageView& image, int width, int height,
                                          const TensorNormalization& normalization) {
  const bool is_yuv = image.format == PixelFormat::kNv12 || image.format == PixelFormat::kNv21 ||
                      image.format == PixelFormat::kI420;
  const auto plane_size = static_cast<size_t>(width) * static_cast<size_t>(height);
  std::vector<float> tensor(3 * plane_size);
  for (int y = 0; y < height; ++y) {
    const Tap ty = MakeTap(y, height, image.height_px);
    for (int x = 0; x < width; ++x) {
      const Tap tx = MakeTap(x, width, image.width_px);
      const Rgb a = PixelAt(image, tx.first, ty.first), b = PixelAt(image, tx.second, ty.first);
      const Rgb c = PixelAt(image, tx.first, ty.second), d = PixelAt(image, tx.second, ty.second);
      for (size_t channel = 0; channel < 3; ++channel) {
        const float top = a[channel] + tx.weight * (b[channel] - a[channel]);
        const float bottom = c[channel] + tx.weight * (d[channel] - c[channel]);
        float v = top + ty.weight * (bottom - top);
        if (is_yuv) v = std::clamp(v, 0.0f, 255.0f);
        tensor[channel * plane_size + static_cast<size_t>(y) * static_cast<size_t>(width) +
               static_cast<size_t>(x)] =
            (v - normalization.mean[channel]) / normalization.standard_deviation[channel];
      }
    }
  }
  return tensor;
}

}  // namespace plumb
