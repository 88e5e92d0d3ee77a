// The image kernel against its CPU twin, and the twin against OpenCV.
#include "plumb/features/image_preprocessor.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

#include <random>
#include <tuple>

#include "support/gpu_fixture.h"

namespace plumb {
namespace {

using ::testing::HasSubstr;

const TensorNormalization kNormalization = {{109.730f, 103.832f, 98.681f},
                                            {22.275f, 22.124f, 23.229f}};

// Random pixels in rows that are `padding` bytes longer than needed.
struct TestImage {
  TestImage(PixelFormat format, int width, int height, int padding, uint32_t seed = 1) {
    view.format = format;
    view.width_px = width;
    view.height_px = height;
    const auto add = [&](size_t i, int row_bytes, int rows) {
      planes[i].resize(static_cast<size_t>(row_bytes + padding) * static_cast<size_t>(rows));
      view.planes[i] = {planes[i].data(), row_bytes + padding};
    };
    switch (format) {
      case PixelFormat::kGray8:
        add(0, width, height);
        break;
      case PixelFormat::kRgb8:
      case PixelFormat::kBgr8:
        add(0, 3 * width, height);
        break;
      case PixelFormat::kNv12:
      case PixelFormat::kNv21:
        add(0, width, height);
        add(1, width, height / 2);
        break;
      case PixelFormat::kI420:
        add(0, width, height);
        add(1, width / 2, height / 2);
        add(2, width / 2, height / 2);
        break;
    }
    std::mt19937 random(seed);
    for (auto& plane : planes) {
      for (uint8_t& byte : plane) byte = static_cast<uint8_t>(random());
    }
  }
  TestImage(const TestImage&) = delete;
  TestImage& operator=(const TestImage&) = delete;

  ImageView view;
  std::array<std::vector<uint8_t>, 3> planes;
};

struct Sizes {
  int image_width, image_height, tensor_width, tensor_height, padding;
};

class ImagePreprocessorTest : public testing::GpuTest {
 protected:
  void ExpectMatchesReference(const TestImage& image, int width, int height,
                              nn::KernelFamily family) {
    Result<std::unique_ptr<ImagePreprocessor>> preprocessor =
        ImagePreprocessor::Create(device_, {.format = image.view.format,
                                            .image_width_px = image.view.width_px,
                                            .image_height_px = image.view.height_px,
                                            .tensor_width_px = width,
                                            .tensor_height_px = height,
                                            .normalization = kNormalization,
                                            .family = family});
    PLUMB_ASSERT_OK(preprocessor);
    const size_t size = 3 * static_cast<size_t>(width) * static_cast<size_t>(height);
    const auto tensor = MakeBuffer(std::vector<float>(size, -1e9f));
    auto recorder = gpu::Recorder::Create(device_);
    PLUMB_ASSERT_OK(recorder);
    (*preprocessor)->Record(**recorder, tensor->All());
    auto commands = (*recorder)->Finish();
    PLUMB_ASSERT_OK(commands);
    (*preprocessor)->Upload(image.view);
    PLUMB_ASSERT_OK((*commands)->Run());

    const std::vector<float> expected =
        ImageToTensorReference(image.view, width, height, kNormalization);
    const std::vector<float> actual = Read<float>(tensor->All());
    for (size_t i = 0; i < size; ++i) {
      // 1e-4 of the value's scale, which is about one standard deviation.
      ASSERT_NEAR(actual[i], expected[i], 1e-4 * std::max(1.0f, std::abs(expected[i]))) << i;
    }
  }
};

class AllFormatsTest : public ImagePreprocessorTest,
                       public ::testing::WithParamInterface<std::tuple<PixelFormat, Sizes>> {};

TEST_P(AllFormatsTest, KernelMatchesReference) {
  const auto& [format, sizes] = GetParam();
  const bool has_chroma =
      format != PixelFormat::kGray8 && format != PixelFormat::kRgb8 && format != PixelFormat::kBgr8;
  const auto even = [&](int side) { return has_chroma ? side + side % 2 : side; };
  const TestImage image(format, even(sizes.image_width), even(sizes.image_height), sizes.padding);
  ASSERT_TRUE(image.view.Validate());
  ExpectMatchesReference(image, sizes.tensor_width, sizes.tensor_height, nn::KernelFamily::kGpu);
  const gpu::DeviceFeatures& features = device_->Info().features;
  if (!features.shader_int64) GTEST_SKIP() << "no 64-bit stores: only kGpu was checked";
  ExpectMatchesReference(image, sizes.tensor_width, sizes.tensor_height,
                         nn::KernelFamily::kCpuSimd);
}

// Halved as in the frame loop; equal; odd sizes and strides; enlarged; a single pixel; anisotropic.
INSTANTIATE_TEST_SUITE_P(
    Sizes, AllFormatsTest,
    ::testing::Combine(::testing::Values(PixelFormat::kGray8, PixelFormat::kRgb8,
                                         PixelFormat::kBgr8, PixelFormat::kNv12, PixelFormat::kNv21,
                                         PixelFormat::kI420),
                       ::testing::Values(Sizes{128, 128, 64, 64, 0}, Sizes{64, 64, 64, 64, 0},
                                         Sizes{101, 67, 64, 128, 5}, Sizes{13, 9, 64, 64, 3},
                                         Sizes{1, 1, 64, 64, 0}, Sizes{641, 31, 192, 64, 1})));

TEST_F(ImagePreprocessorTest, ANewUploadIsSeenByTheSameRecording) {
  Result<std::unique_ptr<ImagePreprocessor>> preprocessor =
      ImagePreprocessor::Create(device_, {.format = PixelFormat::kRgb8,
                                          .image_width_px = 32,
                                          .image_height_px = 32,
                                          .tensor_width_px = 64,
                                          .tensor_height_px = 64,
                                          .normalization = kNormalization,
                                          .family = nn::KernelFamily::kAuto});
  PLUMB_ASSERT_OK(preprocessor);
  const auto tensor = MakeBuffer(std::vector<float>(3 * 64 * 64));
  auto recorder = gpu::Recorder::Create(device_);
  (*preprocessor)->Record(**recorder, tensor->All());
  auto commands = (*recorder)->Finish();
  PLUMB_ASSERT_OK(commands);
  for (uint32_t seed = 0; seed < 3; ++seed) {
    const TestImage image(PixelFormat::kRgb8, 32, 32, 2, seed);
    (*preprocessor)->Upload(image.view);
    PLUMB_ASSERT_OK((*commands)->Run());
    const float expected = ImageToTensorReference(image.view, 64, 64, kNormalization)[777];
    EXPECT_NEAR(Read<float>(tensor->All())[777], expected, 1e-3);
  }
}

TEST_F(ImagePreprocessorTest, ASizeOutOfRangeIsNamed) {
  const auto preprocessor = ImagePreprocessor::Create(device_, {.format = PixelFormat::kRgb8,
                                                                .image_width_px = 0,
                                                                .image_height_px = 32,
                                                                .tensor_width_px = 64,
                                                                .tensor_height_px = 64,
                                                                .normalization = kNormalization,
                                                                .family = nn::KernelFamily::kAuto});
  ASSERT_FALSE(preprocessor);
  EXPECT_EQ(preprocessor.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(preprocessor.error().message, HasSubstr("image_width_px 0"));
}

TEST(ImageToTensorReference, ResizesAsOpenCvDoes) {
  for (const Sizes& sizes : {Sizes{640, 480, 320, 320, 0}, Sizes{37, 53, 64, 128, 4}}) {
    const TestImage image(PixelFormat::kRgb8, sizes.image_width, sizes.image_height, sizes.padding);
    const cv::Mat rgb(sizes.image_height, sizes.image_width, CV_8UC3,
                      const_cast<uint8_t*>(image.planes[0].data()),
                      static_cast<size_t>(image.view.planes[0].row_stride_bytes));
    cv::Mat as_float, resized;
    rgb.convertTo(as_float, CV_32F);
    cv::resize(as_float, resized, cv::Size(sizes.tensor_width, sizes.tensor_height), 0, 0,
               cv::INTER_LINEAR);
    const std::vector<float> tensor =
        ImageToTensorReference(image.view, sizes.tensor_width, sizes.tensor_height, {});
    const size_t plane = static_cast<size_t>(sizes.tensor_width * sizes.tensor_height);
    for (int y = 0; y < sizes.tensor_height; ++y) {
      for (int x = 0; x < sizes.tensor_width; ++x) {
        const auto expected = resized.at<cv::Vec3f>(y, x);
        const auto index = static_cast<size_t>(y * sizes.tensor_width + x);
        for (size_t c = 0; c < 3; ++c) {
          ASSERT_NEAR(tensor[c * plane + index], expected[static_cast<int>(c)], 1e-2);
        }
      }
    }
  }
}

// Colours that JFIF's equations give to full-range YUV.
TEST(ImageToTensorReference, ConvertsFullRangeYuv) {
  const struct {
    uint8_t y, u, v;
    std::array<float, 3> rgb;
  } colours[] = {{0, 128, 128, {0, 0, 0}},
                 {255, 128, 128, {255, 255, 255}},
                 {76, 85, 255, {254, 0, 0}},
                 {150, 44, 21, {0, 255, 1}},
                 {29, 255, 107, {0, 0, 254}}};
  for (const auto& colour : colours) {
    TestImage image(PixelFormat::kNv12, 2, 2, 0);
    image.planes[0].assign(4, colour.y);
    image.planes[1] = {colour.u, colour.v};
    image.view.planes[0].data = image.planes[0].data();
    image.view.planes[1].data = image.planes[1].data();
    const std::vector<float> tensor = ImageToTensorReference(image.view, 2, 2, {});
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(tensor[4 * c], colour.rgb[c], 1.5) << c;
  }
}

TEST(ImageToTensorReference, Nv21SwapsTheChromaOfNv12) {
  TestImage nv12(PixelFormat::kNv12, 8, 6, 0), nv21(PixelFormat::kNv21, 8, 6, 0);
  nv21.planes[0] = nv12.planes[0];
  for (size_t i = 0; i < nv12.planes[1].size(); i += 2) {
    nv21.planes[1][i] = nv12.planes[1][i + 1];
    nv21.planes[1][i + 1] = nv12.planes[1][i];
  }
  nv21.view.planes[0].data = nv21.planes[0].data();
  nv21.view.planes[1].data = nv21.planes[1].data();
  EXPECT_EQ(ImageToTensorReference(nv12.view, 16, 16, {}),
            ImageToTensorReference(nv21.view, 16, 16, {}));
}

}  // namespace
}  // namespace plumb
