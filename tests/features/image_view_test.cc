// Which images are valid, and how their planes are laid out.
#include "plumb/features/image_view.h"

#include <string>

#include <gtest/gtest.h>

namespace plumb {
namespace {

const uint8_t kByte = 0;

ImageView Image(PixelFormat format, int width, int height) {
  ImageView image;
  image.format = format;
  image.width_px = width;
  image.height_px = height;
  for (size_t i = 0; i < static_cast<size_t>(NumPlanes(format)); ++i) {
    image.planes[i] = {&kByte, RowBytes(format, i, width)};
  }
  return image;
}

void ExpectInvalid(const ImageView& image, const std::string& part) {
  const Status status = image.Validate();
  ASSERT_FALSE(status) << part;
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(status.error().message.find(part), std::string::npos) << status.error().message;
}

TEST(ImageView, EveryFormatIsValidWithTightRows) {
  for (const PixelFormat format : {PixelFormat::kGray8, PixelFormat::kRgb8, PixelFormat::kBgr8,
                                   PixelFormat::kNv12, PixelFormat::kNv21, PixelFormat::kI420}) {
    EXPECT_TRUE(Image(format, 64, 48).Validate()) << static_cast<int>(format);
  }
}

TEST(ImageView, ChromaPlanesHaveHalfTheRows) {
  EXPECT_EQ(NumRows(PixelFormat::kNv12, 0, 48), 48);
  EXPECT_EQ(NumRows(PixelFormat::kNv12, 1, 48), 24);
  EXPECT_EQ(NumRows(PixelFormat::kI420, 2, 48), 24);
  EXPECT_EQ(RowBytes(PixelFormat::kNv21, 1, 64), 64);
  EXPECT_EQ(RowBytes(PixelFormat::kI420, 2, 64), 32);
  EXPECT_EQ(RowBytes(PixelFormat::kBgr8, 0, 64), 192);
}

TEST(ImageView, SizeIsOneTo16384) {
  EXPECT_TRUE(Image(PixelFormat::kGray8, 1, 1).Validate());
  EXPECT_TRUE(Image(PixelFormat::kGray8, 16384, 16384).Validate());
  ExpectInvalid(Image(PixelFormat::kGray8, 0, 1), "width_px 0");
  ExpectInvalid(Image(PixelFormat::kGray8, 1, -3), "height_px -3");
  ExpectInvalid(Image(PixelFormat::kGray8, 16385, 1), "width_px 16385");
}

TEST(ImageView, SubsampledChromaNeedsEvenSizes) {
  ExpectInvalid(Image(PixelFormat::kNv12, 63, 48), "63 x 48");
  ExpectInvalid(Image(PixelFormat::kI420, 64, 47), "64 x 47");
  EXPECT_TRUE(Image(PixelFormat::kRgb8, 63, 47).Validate());
}

TEST(ImageView, MissingPlaneIsNamed) {
  ImageView image = Image(PixelFormat::kI420, 64, 48);
  image.planes[2].data = nullptr;
  ExpectInvalid(image, "planes[2].data");
}

TEST(ImageView, ShortOrNegativeStrideIsNamed) {
  ImageView image = Image(PixelFormat::kRgb8, 64, 48);
  image.planes[0].row_stride_bytes = 191;
  ExpectInvalid(image, "planes[0].row_stride_bytes 191");
  image.planes[0].row_stride_bytes = -192;
  ExpectInvalid(image, "-192");
}

TEST(ImageView, UnknownFormatIsRefused) {
  ImageView image = Image(PixelFormat::kGray8, 4, 4);
  image.format = static_cast<PixelFormat>(77);
  ExpectInvalid(image, "format 77");
}

}  // namespace
}  // namespace plumb
