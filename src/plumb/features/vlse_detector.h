// The VLSE network as a line detector: image in, segments out, one submission to the device a
// frame.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/features/duplicate_decay.h"
#include "plumb/features/image_preprocessor.h"
#include "plumb/features/line_detector.h"
#include "plumb/features/vlse_decoder.h"
#include "plumb/gpu/command_list.h"
#include "plumb/gpu/device.h"
#include "plumb/nn/network.h"

namespace plumb {

struct VlseDetectorOptions {
  /// The weights: a safetensors file with plumb.model/1 metadata, or its bytes (borrowed during
  /// Create()). Exactly one of the two.
  std::string model_path = {};
  std::span<const std::byte> model_data = {};

  std::shared_ptr<gpu::Device> device =
      nullptr;  ///< Shared with others; null: opened by `device_options`.
  gpu::DeviceOptions device_options = {};
  nn::KernelFamily family = nn::KernelFamily::kAuto;

  int input_width_px = 0,
      input_height_px = 0;                    ///< Of the network, multiples of 64; 0: the model's.
  std::optional<float> score_threshold = {};  ///< 0..1; absent: the model's.
  std::optional<int> max_lines = {};          ///< 1..4096; absent: the model's.

  /// Run once on a black image, so that drivers which compile at the first use do it in Create().
  bool warm_up = true;
  /// Longest time that Collect() waits for the device.
  std::chrono::nanoseconds timeout = std::chrono::seconds(30);
};

/// Preprocessing, network and decoding are recorded once per image size and format; a frame costs
/// a copy of the image, one submission and one wait. Not thread-safe.
class VlseDetector : public LineDetector {
 public:
  /// @return kNotFound, kCorruptData or kUnsupported for the weights; kInvalidArgument that names
  /// an option out of range; errors of the device.
  static Result<std::unique_ptr<VlseDetector>> Create(const VlseDetectorOptions& options);

  /// Copies the image and starts the device; does not wait. Records anew when the image's size or
  /// format differs from the last one's.
  Status Submit(const ImageView& image) override;

  /// Waits; kInternal after `timeout`, and the image then stays in flight. The segments are clipped
  /// to the image.
  Result<std::vector<Segment2>> Collect() override;

  bool WorksInBackground() const override { return true; }

  /// The model's preset.
  std::string Name() const override { return name_; }

  std::string DeviceName() const override { return device_->Info().name; }

  ImageSize InputSize() const override {
    return {network_->info().input_width, network_->info().input_height};
  }

  /// Device time of "preprocess", "network" and "decode" for the last collected image; empty where
  /// the device has no timestamps.
  std::span<const gpu::StageTime> StageTimes() const { return stage_times_; }

  const nn::NetworkInfo& GetNetworkInfo() const { return network_->info(); }

 private:
  VlseDetector() = default;
  Status Record(const ImageView& image);
  Status WarmUp();

  std::shared_ptr<gpu::Device> device_;
  std::string name_;
  TensorNormalization normalization_;
  DuplicateDecay duplicate_decay_;
  float score_threshold_ = 0.0f;
  nn::KernelFamily family_ = nn::KernelFamily::kAuto;
  std::chrono::nanoseconds timeout_{0};
  std::unique_ptr<nn::Network> network_;
  std::unique_ptr<VlseDecoder> decoder_;
  std::unique_ptr<ImagePreprocessor> preprocessor_;  // Of the last image's size and format.
  std::unique_ptr<gpu::CommandList> commands_;       // Last: it uses all of the above.
  std::vector<gpu::StageTime> stage_times_;
  std::vector<DecodedLine> lines_;  // Of the last image.
};

}  // namespace plumb
