// Times the network on a Vulkan device and prints one line per layer kind: the developers' profile.
//
// usage: net_bench [MODEL.safetensors | PRESET] [SIZE] [FRAMES] [auto|cpu-simd|gpu] [layers]
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "plumb/gpu/device.h"
#include "plumb/nn/network_bench.h"

namespace {

using plumb::nn::KernelFamily;

int Fail(const plumb::Error& error) {
  std::fprintf(stderr, "net_bench: %s\n", error.message.c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "nano";
  plumb::nn::NetworkBenchOptions options;
  const int size = argc > 2 ? std::atoi(argv[2]) : 320;
  options.network.input_width = options.network.input_height = size;
  options.num_frames = argc > 3 ? std::atoi(argv[3]) : 50;
  const std::string family = argc > 4 ? argv[4] : "auto";
  options.network.family = family == "gpu"        ? KernelFamily::kGpu
                           : family == "cpu-simd" ? KernelFamily::kCpuSimd
                                                  : KernelFamily::kAuto;
  options.times_layers = argc > 5;

  auto spec = plumb::nn::PresetSpec(what);
  auto model = spec ? plumb::Result(plumb::nn::RandomModel(*spec, 1)) : plumb::nn::LoadModel(what);
  if (!model) return Fail(model.error());
  auto device = plumb::gpu::Device::Create({});
  if (!device) return Fail(device.error());
  auto result = plumb::nn::BenchNetwork(*device, *model, options);
  if (!result) return Fail(result.error());
  std::vector<double> cpu = result->frame_cpu_ms;
  std::sort(cpu.begin(), cpu.end());

  std::vector<double> sorted = result->frame_ms;
  std::sort(sorted.begin(), sorted.end());
  const auto& info = result->info;
  std::printf("%s, %s, %dx%d, %.2f GMAC, %d dispatches, %.1f MB activations\n",
              plumb::gpu::Describe((*device)->Info()).c_str(), ToString(info.family),
              info.input_width, info.input_height, info.gmac, info.num_dispatches,
              static_cast<double>(info.activation_bytes) * 1e-6);
  std::printf(
      "create %.0f ms, first frame %.0f ms, best %.2f ms, median %.2f ms, cpu best %.2f ms, median "
      "%.2f ms\n",
      result->create_ms, result->first_frame_ms, sorted.front(), sorted[sorted.size() / 2],
      cpu.front(), cpu[cpu.size() / 2]);
  for (const auto& layer : result->layers) {
    std::printf("%10.1f us  %s\n", static_cast<double>(layer.duration_ns) * 1e-3,
                layer.name.c_str());
  }
  return 0;
}
