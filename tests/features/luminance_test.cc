// Luminance of every format.
#include "plumb/features/luminance.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

ImageView Packed(PixelFormat format, const std::vector<uint8_t>& pixels, int width, int height,
                 int64_t stride) {
  ImageView image;
  image.format = format;
  image.width_px = width;
  image.height_px = height;
  image.planes[0] = {pixels.data(), stride};
  return image;
}

uint8_t GrayOf(PixelFormat format, uint8_t a, uint8_t b, uint8_t c) {
  const std::vector<uint8_t> pixels = {a, b, c};
  std::vector<uint8_t> buffer;
  return Luminance(Packed(format, pixels, 1, 1, 3), &buffer).Row(0)[0];
}

TEST(Luminance, GrayAndYuvAreViewsOfTheFirstPlane) {
  const std::vector<uint8_t> luma = {1, 2, 3, 4, 5, 6, 7, 8}, chroma(8, 128);
  for (const PixelFormat format :
       {PixelFormat::kGray8, PixelFormat::kNv12, PixelFormat::kNv21, PixelFormat::kI420}) {
    ImageView image = Packed(format, luma, 2, 2, 4);
    image.planes[1] = image.planes[2] = {chroma.data(), 4};
    std::vector<uint8_t> buffer;
    const GrayView gray = Luminance(image, &buffer);
    EXPECT_EQ(gray.data, luma.data());
    EXPECT_EQ(gray.Row(1)[1], 6);
    EXPECT_TRUE(buffer.empty());
  }
}

TEST(Luminance, GreyPixelsKeepTheirValueExactly) {
  for (int v = 0; v <= 255; ++v) {
    const uint8_t g = static_cast<uint8_t>(v);
    EXPECT_EQ(GrayOf(PixelFormat::kRgb8, g, g, g), g);
  }
}

TEST(Luminance, WeighsTheChannelsAsBt601) {
  for (int r = 0; r <= 255; r += 51) {
    for (int g = 0; g <= 255; g += 51) {
      for (int b = 0; b <= 255; b += 51) {
        const double exact = 0.299 * r + 0.587 * g + 0.114 * b;
        const uint8_t r8 = static_cast<uint8_t>(r), g8 = static_cast<uint8_t>(g),
                      b8 = static_cast<uint8_t>(b);
        EXPECT_NEAR(GrayOf(PixelFormat::kRgb8, r8, g8, b8), exact, 0.51);
        EXPECT_EQ(GrayOf(PixelFormat::kBgr8, b8, g8, r8), GrayOf(PixelFormat::kRgb8, r8, g8, b8));
      }
    }
  }
}

TEST(Luminance, PaddedRowsAreSkipped) {
  std::vector<uint8_t> pixels(2 * 8, 255);
  for (int i = 0; i < 6; ++i) pixels[static_cast<size_t>(8 + i)] = 10;
  std::vector<uint8_t> buffer;
  const GrayView gray = Luminance(Packed(PixelFormat::kRgb8, pixels, 2, 2, 8), &buffer);
  EXPECT_EQ(gray.width_px, 2);
  EXPECT_EQ(gray.Row(0)[1], 255);
  EXPECT_EQ(gray.Row(1)[0], 10);
  EXPECT_EQ(gray.Row(1)[1], 10);
}

}  // namespace
}  // namespace plumb
