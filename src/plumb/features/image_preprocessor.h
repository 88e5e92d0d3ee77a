// Camera image to network input on the device: YUV to RGB, resize, normalisation in one kernel.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "plumb/base/result.h"
#include "plumb/features/image_tensor_reference.h"
#include "plumb/features/image_view.h"
#include "plumb/gpu/buffer.h"
#include "plumb/gpu/kernel.h"
#include "plumb/gpu/recorder.h"
#include "plumb/nn/network.h"

namespace plumb {

/// Serves one image size and format; the frame loop makes a new one when these change.
class ImagePreprocessor {
 public:
  struct Options {
    PixelFormat format = PixelFormat::kRgb8;
    int image_width_px = 0, image_height_px = 0;    // 1..16384
    int tensor_width_px = 0, tensor_height_px = 0;  // 2..16384, the width even
    TensorNormalization normalization;
    nn::KernelFamily family = nn::KernelFamily::kAuto;
  };

  /// @return kInvalidArgument that names a size out of range; errors of the device.
  static Result<std::unique_ptr<ImagePreprocessor>> Create(
      const std::shared_ptr<gpu::Device>& device, const Options& options);

  /// Copies the planes to memory that the device reads. Not while a recorded list is in flight.
  /// Precondition: a valid image of this preprocessor's size and format.
  void Upload(const ImageView& image);

  /// Records uploaded image -> `tensor`, [3][tensor_height][tensor_width] fp32. The result equals
  /// ImageToTensorReference() up to rounding.
  void Record(gpu::Recorder& recorder, const gpu::BufferSlice& tensor) const;

  const Options& GetOptions() const { return options_; }

 private:
  // Where a plane lies in the buffer; rows are padded to whole words.
  struct PlaneLayout {
    uint32_t offset_bytes = 0, stride_bytes = 0, row_bytes = 0, num_rows = 0;
  };

  explicit ImagePreprocessor(const Options& options);

  Options options_;
  std::array<PlaneLayout, 3> planes_;
  uint32_t num_planes_ = 0;
  uint64_t size_bytes_ = 0;
  std::unique_ptr<gpu::Kernel> kernel_;
  std::unique_ptr<gpu::Buffer> upload_;
  std::unique_ptr<gpu::Buffer> image_;  // On the device; null where it reads `upload_` itself.
};

}  // namespace plumb
