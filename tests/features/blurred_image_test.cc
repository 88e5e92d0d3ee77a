// The blur against its definition, borders and tiny images included.
#include "plumb/features/blurred_image.h"

#include <cmath>
#include <cstdlib>
#include <random>

#include <gtest/gtest.h>

#include "support/edge_image.h"

namespace plumb {
namespace {

using testing::GrayImage;

GrayImage Noise(int width, int height, uint32_t seed) {
  std::mt19937 random(seed);
  GrayImage image(width, height);
  for (uint8_t& pixel : image.pixels) pixel = static_cast<uint8_t>(random() & 255u);
  return image;
}

int Mirror(int i, int n) {
  if (n == 1) return 0;
  while (i < 0 || i >= n) i = i < 0 ? -i : 2 * (n - 1) - i;
  return i;
}

// Direct two-dimensional convolution in double.
double BlurAt(GrayImage& image, int x, int y) {
  double sum = 0.0, weights = 0.0;
  for (int dy = -4; dy <= 4; ++dy) {
    for (int dx = -4; dx <= 4; ++dx) {
      const double w = std::exp(-0.5 * (dx * dx + dy * dy));
      sum += w * image.At(Mirror(x + dx, image.width_px), Mirror(y + dy, image.height_px));
      weights += w;
    }
  }
  return sum / weights;
}

void ExpectMatchesDefinition(int width, int height) {
  GrayImage image = Noise(width, height, 5);
  BlurredImage blurred;
  blurred.Assign(image.Gray());
  ASSERT_EQ(blurred.width_px(), width);
  ASSERT_EQ(blurred.height_px(), height);
  for (int y = 0; y <= height; ++y) {
    for (int x = 0; x <= width; ++x) {
      const double expected = BlurAt(image, std::min(x, width - 1), std::min(y, height - 1));
      ASSERT_NEAR(blurred.At(x, y), expected, 1e-3)
          << width << " x " << height << ": " << x << ", " << y;
    }
  }
}

TEST(BlurredImage, IsAGaussianOfOnePixel) { ExpectMatchesDefinition(37, 29); }

TEST(BlurredImage, SmallImagesMirrorMoreThanOnce) {
  for (const auto& [width, height] :
       {std::pair(1, 1), std::pair(1, 9), std::pair(9, 1), std::pair(2, 3), std::pair(5, 4)}) {
    ExpectMatchesDefinition(width, height);
  }
}

TEST(BlurredImage, ConstantImageStaysConstant) {
  const GrayImage image(20, 12, 255);
  BlurredImage blurred;
  blurred.Assign(image.Gray());
  for (int y = 0; y <= 12; ++y) {
    for (int x = 0; x <= 20; ++x) EXPECT_NEAR(blurred.At(x, y), 255.0f, 1e-3f);
  }
}

TEST(BlurredImage, HonoursTheStride) {
  GrayImage wide = Noise(24, 10, 9), narrow(16, 10);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 16; ++x) narrow.At(x, y) = wide.At(x, y);
  }
  BlurredImage a, b;
  a.Assign({wide.pixels.data(), 24, 16, 10});
  b.Assign(narrow.Gray());
  for (int y = 0; y <= 10; ++y) {
    for (int x = 0; x <= 16; ++x) EXPECT_EQ(a.At(x, y), b.At(x, y));
  }
}

TEST(BlurredImage, CanBeReusedForAnotherSize) {
  BlurredImage blurred, fresh;
  blurred.Assign(Noise(64, 48, 1).Gray());
  const GrayImage small = Noise(10, 7, 2);
  blurred.Assign(small.Gray());
  fresh.Assign(small.Gray());
  ASSERT_EQ(blurred.stride(), fresh.stride());
  for (int y = 0; y <= 7; ++y) {
    for (int x = 0; x <= 10; ++x) EXPECT_EQ(blurred.At(x, y), fresh.At(x, y));
  }
}

}  // namespace
}  // namespace plumb
