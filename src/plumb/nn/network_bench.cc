// One command list, submitted again and again.
#include "plumb/nn/network_bench.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <ctime>
#include <span>

#include "plumb/gpu/buffer.h"
#include "plumb/gpu/recorder.h"
#include "plumb/gpu/transfer.h"

namespace plumb::nn {
namespace {

using Clock = std::chrono::steady_clock;

double MillisecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

Result<std::unique_ptr<gpu::CommandList>> RecordFrame(const std::shared_ptr<gpu::Device>& device,
                                                      const Network& network,
                                                      bool stage_per_layer) {
  auto recorder =
      gpu::Recorder::Create(device, {.name = "network bench", .has_stage_times = stage_per_layer});
  if (!recorder) return recorder.error();
  network.Record(**recorder, stage_per_layer);
  return (*recorder)->Finish();
}

// Compilation at the first submit can take minutes on a busy machine.
constexpr std::chrono::minutes kTimeout(10);

Result<std::vector<gpu::StageTime>> TimeLayers(const std::shared_ptr<gpu::Device>& device,
                                               const Network& network, int num_frames) {
  auto list = RecordFrame(device, network, true);
  if (!list) return list.error();
  std::vector<gpu::StageTime> layers;
  for (int frame = 0; frame < num_frames; ++frame) {
    if (const Status status = (*list)->Run(kTimeout); !status) return status.error();
    const std::vector<gpu::StageTime>& times = (*list)->StageTimes();
    if (layers.empty()) layers = times;
    for (size_t i = 0; i < layers.size(); ++i) {
      layers[i].duration_ns = std::min(layers[i].duration_ns, times[i].duration_ns);
    }
  }
  return layers;
}

}  // namespace

Result<NetworkBenchResult> BenchNetwork(const std::shared_ptr<gpu::Device>& device,
                                        const Model& model, const NetworkBenchOptions& options) {
  if (options.num_frames < 1 || options.num_warm_up < 0) {
    return Error{ErrorCode::kInvalidArgument,
                 "bench: " + std::to_string(options.num_frames) + " frames cannot be timed"};
  }
  NetworkBenchResult result;
  auto start = Clock::now();
  auto network = Network::Create(device, model, options.network);
  if (!network) return network.error();
  result.create_ms = MillisecondsSince(start);
  result.info = (*network)->info();

  std::vector<float> image((*network)->input().SizeBytes() / sizeof(float));
  uint32_t state = 1;
  for (float& value : image) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<float>(state >> 8) * 0x1p-22f - 2.0f;
  }
  if (const Status status =
          gpu::UploadNow(device, (*network)->input().All(), std::as_bytes(std::span(image)));
      !status) {
    return status.error();
  }
  auto list = RecordFrame(device, **network, false);
  if (!list) return list.error();
  for (int frame = -1 - options.num_warm_up; frame < options.num_frames; ++frame) {
    start = Clock::now();
    const std::clock_t cpu_start = std::clock();
    if (const Status status = (*list)->Run(kTimeout); !status) return status.error();
    const double ms = MillisecondsSince(start);
    if (frame == -1 - options.num_warm_up) result.first_frame_ms = ms;
    if (frame < 0) continue;
    result.frame_ms.push_back(ms);
    result.frame_cpu_ms.push_back(1e3 * static_cast<double>(std::clock() - cpu_start) /
                                  CLOCKS_PER_SEC);
  }
  if (options.times_layers) {
    auto layers = TimeLayers(device, **network, options.num_frames);
    if (!layers) return layers.error();
    result.layers = *std::move(layers);
  }
  return result;
}

}  // namespace plumb::nn
