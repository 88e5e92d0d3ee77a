// From the network's output planes to lines on the device: scores, soft NMS, top-K, end points.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "plumb/base/result.h"
#include "plumb/features/vlse_decode_reference.h"
#include "plumb/gpu/buffer.h"
#include "plumb/gpu/kernel.h"
#include "plumb/gpu/recorder.h"
#include "plumb/nn/network.h"

namespace plumb {

/// Three kernels: score every cell, select the best, emit their lines in order.
class VlseDecoder {
 public:
  /// @return kInvalidArgument that names an option out of range; errors of the device.
  static Result<std::unique_ptr<VlseDecoder>> Create(
      std::shared_ptr<gpu::Device> device, const DecodeOptions& options,
      nn::KernelFamily family = nn::KernelFamily::kAuto);

  /// Records planes [6][height][width] -> lines in pixels of an image of this size, as
  /// DecodeLinesReference() gives them up to rounding.
  void Record(gpu::Recorder& recorder, const gpu::BufferSlice& planes, int image_width_px,
              int image_height_px) const;

  /// The lines of the last finished run, best first; valid until the next one starts.
  std::span<const DecodedLine> Lines() const;

 private:
  explicit VlseDecoder(const DecodeOptions& options) : options_(options) {}

  DecodeOptions options_;
  std::unique_ptr<gpu::Kernel> score_, select_, emit_;
  std::unique_ptr<gpu::Buffer> scratch_, result_;
  gpu::BufferSlice cell_scores_, chosen_scores_, chosen_cells_, chosen_count_;  // of `scratch_`
};

}  // namespace plumb
