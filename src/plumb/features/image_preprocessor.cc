#include "plumb/features/image_preprocessor.h"

#include <cstring>
#include <string>
#include <tuple>
#include <utility>

#include "shaders/image/preprocess_params.h"
#include "shaders/registry.h"

namespace plumb {
namespace {

constexpr int kMaxSide = 16384;
constexpr uint32_t kWorkgroupX = 32, kWorkgroupY = 4;
// The kernel reads up to two words beyond a row's last pixel, with weight 0.
constexpr uint32_t kPaddingBytes = 16;

uint32_t FormatConstant(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGray8:
      return shaders::kPreprocessGray8;
    case PixelFormat::kRgb8:
      return shaders::kPreprocessRgb8;
    case PixelFormat::kBgr8:
      return shaders::kPreprocessBgr8;
    case PixelFormat::kNv12:
      return shaders::kPreprocessNv12;
    case PixelFormat::kNv21:
      return shaders::kPreprocessNv21;
    case PixelFormat::kI420:
      return shaders::kPreprocessI420;
  }
  return shaders::kPreprocessRgb8;
}

Status CheckSide(const char* name, int value, int least) {
  if (value >= least && value <= kMaxSide) return Ok();
  return Error{ErrorCode::kInvalidArgument, std::string("ImagePreprocessor: ") + name + " " +
                                                std::to_string(value) + " is outside " +
                                                std::to_string(least) + "..16384"};
}

Status Check(const ImagePreprocessor::Options& options) {
  const std::tuple<const char*, int, int> sides[] = {
      {"image_width_px", options.image_width_px, 1},
      {"image_height_px", options.image_height_px, 1},
      {"tensor_width_px", options.tensor_width_px, 2},
      {"tensor_height_px", options.tensor_height_px, 2}};
  for (const auto& [name, value, least] : sides) {
    if (const Status valid = CheckSide(name, value, least); !valid) return valid.error();
  }
  if (options.tensor_width_px % 2 != 0) {
    return Error{ErrorCode::kInvalidArgument, "ImagePreprocessor: tensor_width_px " +
                                                  std::to_string(options.tensor_width_px) +
                                                  " is odd"};
  }
  return Ok();
}

}  // namespace

ImagePreprocessor::ImagePreprocessor(const Options& options) : options_(options) {
  const auto width = static_cast<uint32_t>(options.image_width_px);
  const auto height = static_cast<uint32_t>(options.image_height_px);
  const auto add_plane = [&](uint32_t row_bytes, uint32_t num_rows) {
    PlaneLayout& plane = planes_[num_planes_++];
    plane = {static_cast<uint32_t>(size_bytes_), (row_bytes + 3) / 4 * 4, row_bytes, num_rows};
    size_bytes_ += uint64_t{plane.stride_bytes} * num_rows;
  };
  switch (options.format) {
    case PixelFormat::kGray8:
      add_plane(width, height);
      break;
    case PixelFormat::kRgb8:
    case PixelFormat::kBgr8:
      add_plane(3 * width, height);
      break;
    case PixelFormat::kNv12:
    case PixelFormat::kNv21:
      add_plane(width, height);
      add_plane(width, height / 2);
      break;
    case PixelFormat::kI420:
      add_plane(width, height);
      add_plane(width / 2, height / 2);
      add_plane(width / 2, height / 2);
      break;
  }
  size_bytes_ += kPaddingBytes;
}

Result<std::unique_ptr<ImagePreprocessor>> ImagePreprocessor::Create(
    const std::shared_ptr<gpu::Device>& device, const Options& options) {
  if (const Status valid = Check(options); !valid) return valid.error();
  std::unique_ptr<ImagePreprocessor> preprocessor(new ImagePreprocessor(options));

  const bool is_cpu_simd = options.family == nn::KernelFamily::kAuto
                               ? device->Info().IsLavapipe()
                               : options.family == nn::KernelFamily::kCpuSimd;
  auto kernel = gpu::Kernel::Create(
      device,
      {.name = "image/preprocess",
       .spirv = shaders::Find(is_cpu_simd ? "image/preprocess_cpu_simd" : "image/preprocess_gpu"),
       .bindings = {{0, is_cpu_simd ? gpu::BindingKind::kTexelR32Uint : gpu::BindingKind::kStorage,
                     gpu::Access::kRead},
                    {1, gpu::BindingKind::kStorage, gpu::Access::kWrite}},
       .push_constant_bytes = sizeof(shaders::PreprocessParams),
       .spec_constants = {gpu::SpecConstant::Uint(0, kWorkgroupX),
                          gpu::SpecConstant::Uint(1, kWorkgroupY),
                          gpu::SpecConstant::Uint(2, FormatConstant(options.format))}});
  if (!kernel) return kernel.error();
  preprocessor->kernel_ = std::move(*kernel);

  auto upload = gpu::Buffer::Create(
      device, {"image upload", preprocessor->size_bytes_, gpu::MemoryUse::kUpload});
  if (!upload) return upload.error();
  preprocessor->upload_ = std::move(*upload);
  std::memset(preprocessor->upload_->Data(), 0, preprocessor->size_bytes_);

  if (!device->Info().IsSoftware()) {
    auto image =
        gpu::Buffer::Create(device, {"image", preprocessor->size_bytes_, gpu::MemoryUse::kDevice});
    if (!image) return image.error();
    preprocessor->image_ = std::move(*image);
  }
  return preprocessor;
}

void ImagePreprocessor::Upload(const ImageView& image) {
  for (uint32_t i = 0; i < num_planes_; ++i) {
    const PlaneLayout& plane = planes_[i];
    const ImageView::Plane& source = image.planes[i];
    std::byte* to = upload_->Data() + plane.offset_bytes;
    if (source.row_stride_bytes == plane.stride_bytes && plane.row_bytes == plane.stride_bytes) {
      std::memcpy(to, source.data, size_t{plane.stride_bytes} * plane.num_rows);
      continue;
    }
    for (uint32_t row = 0; row < plane.num_rows; ++row) {
      std::memcpy(to + size_t{row} * plane.stride_bytes,
                  source.data + static_cast<int64_t>(row) * source.row_stride_bytes,
                  plane.row_bytes);
    }
  }
}

void ImagePreprocessor::Record(gpu::Recorder& recorder, const gpu::BufferSlice& tensor) const {
  gpu::BufferSlice source = upload_->All();
  if (image_ != nullptr) {
    recorder.Copy(source, image_->All());
    source = image_->All();
  }
  shaders::PreprocessParams params{};
  params.in_width = static_cast<uint32_t>(options_.image_width_px);
  params.in_height = static_cast<uint32_t>(options_.image_height_px);
  params.out_width = static_cast<uint32_t>(options_.tensor_width_px);
  params.out_height = static_cast<uint32_t>(options_.tensor_height_px);
  params.scale_x = static_cast<float>(params.in_width) / static_cast<float>(params.out_width);
  params.scale_y = static_cast<float>(params.in_height) / static_cast<float>(params.out_height);
  params.offset0 = planes_[0].offset_bytes;
  params.offset1 = planes_[1].offset_bytes;
  params.offset2 = planes_[2].offset_bytes;
  params.stride0 = planes_[0].stride_bytes;
  params.stride1 = planes_[1].stride_bytes;
  params.stride2 = planes_[2].stride_bytes;
  const TensorNormalization& normalization = options_.normalization;
  params.mean_r = normalization.mean[0];
  params.mean_g = normalization.mean[1];
  params.mean_b = normalization.mean[2];
  params.gain_r = 1.0f / normalization.standard_deviation[0];
  params.gain_g = 1.0f / normalization.standard_deviation[1];
  params.gain_b = 1.0f / normalization.standard_deviation[2];
  const gpu::Groups groups{(params.out_width / 2 + kWorkgroupX - 1) / kWorkgroupX,
                           (params.out_height + kWorkgroupY - 1) / kWorkgroupY};
  recorder.Dispatch(*kernel_, {source, tensor}, params, groups);
}

}  // namespace plumb
