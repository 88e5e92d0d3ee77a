// The VLSE network on a Vulkan device: from the normalised image tensor to six output planes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/nn/model_file.h"

namespace plumb::gpu {
class Buffer;
class Device;
class Recorder;
}  // namespace plumb::gpu

namespace plumb::nn {

/// Set of kernels. All compute the same network within 1e-4 relative.
enum class KernelFamily {
  kAuto,     ///< By the device: kCpuSimd on llvmpipe, kGpu elsewhere.
  kCpuSimd,  ///< fp32 in blocks of 8 pixels, for Vulkan drivers that run on the CPU.
  kGpu,      ///< Portable implicit GEMM with shared-memory tiles.
};

struct NetworkOptions {
  KernelFamily family = KernelFamily::kAuto;
  int input_width = 0;   ///< Pixels, multiple of 64; 0 takes the model's.
  int input_height = 0;  ///< Pixels, multiple of 64; 0 takes the model's.
};

/// Facts about a created network.
struct NetworkInfo {
  KernelFamily family = KernelFamily::kAuto;  ///< The chosen one, never kAuto.
  int input_width = 0;
  int input_height = 0;
  int output_width = 0;   ///< input_width / 4.
  int output_height = 0;  ///< input_height / 4.
  double gmac = 0;        ///< 1e9 multiply-adds of one frame, counted on the fused layers.
  int num_dispatches = 0;
  size_t weight_bytes = 0;
  size_t activation_bytes = 0;  ///< Of the planned arena.
};

/// Weights, planned activations and pipelines of one network on one device.
///
/// The network owns its input and output buffer: the image kernel writes input(), the decoder reads
/// output(). Record() may be called for several recorders, but only one of them may be in flight at
/// a time, since all share the activations. Input and output are device memory
/// (MemoryUse::kDevice).
class Network {
 public:
  /// Folds, plans, uploads and builds all pipelines.
  /// @return kInvalidArgument for a bad input size; kUnsupported when the device lacks what the
  /// family needs; device errors otherwise.
  static Result<std::unique_ptr<Network>> Create(std::shared_ptr<gpu::Device> device,
                                                 const Model& model,
                                                 const NetworkOptions& options = {});
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  const NetworkInfo& info() const;

  /// [3][input_height][input_width] fp32, RGB, normalised by the model's mean and std.
  const gpu::Buffer& input() const;

  /// [6][output_height][output_width] fp32: loc logits 2, off logits 2 (x, y), dis 2 (dx, dy).
  const gpu::Buffer& output() const;

  /// Appends every dispatch of a frame: input() -> output(); failures surface in
  /// Recorder::Finish().
  /// @param stage_per_layer begins a recorder stage for every layer, for profiling.
  void Record(gpu::Recorder& recorder, bool stage_per_layer = false) const;

 private:
  struct Impl;
  explicit Network(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

const char* ToString(KernelFamily family);

}  // namespace plumb::nn
