// plumbline bench net: time of a network on a device.
#include <cstdio>
#include <memory>
#include <string>

#include "plumb/nn/model_file.h"
#include "plumb/nn/network_bench.h"
#include "tools/metrics/percentile.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/detector_choice.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

struct BenchNetOptions {
  std::string preset = "nano";
  int size = 320;
  std::string device = "auto";
  std::string family = "auto";
  int frames = 50;
  bool layers = false;
  bool json = false;
};

nn::KernelFamily FamilyOf(const std::string& name) {
  if (name == "cpu-simd") return nn::KernelFamily::kCpuSimd;
  return name == "gpu" ? nn::KernelFamily::kGpu : nn::KernelFamily::kAuto;
}

Outcome RunBenchNet(const BenchNetOptions& options) {
  const Result<nn::ModelSpec> spec = nn::PresetSpec(options.preset);
  if (!spec) return FailureFrom(spec.error());
  nn::NetworkBenchOptions bench;
  bench.network.family = FamilyOf(options.family);
  bench.network.input_width = bench.network.input_height = options.size;
  bench.num_frames = options.frames;
  bench.times_layers = options.layers;
  if (const Status valid = nn::ValidateInputSize(options.size, options.size); !valid) {
    return FailureFrom(valid.error());
  }
  std::shared_ptr<gpu::Device> device;
  if (Outcome failed = OpenDevice(options.device, &device)) return failed;
  // The time does not depend on the weights.
  const Result<nn::NetworkBenchResult> result =
      nn::BenchNetwork(device, nn::RandomModel(*spec, 1), bench);
  if (!result) {
    const bool device_lacks = result.error().code == ErrorCode::kUnsupported;
    return Failure{device_lacks ? kExitNoDevice : ExitCodeOf(result.error().code),
                   result.error().message};
  }
  const double median_ms = Percentile(result->frame_ms, 50.0);
  const double p95_ms = Percentile(result->frame_ms, 95.0);
  if (!options.json) {
    char text[300];
    std::snprintf(text, sizeof(text),
                  "%s at %d: median %.2f ms, p95 %.2f ms, %.3f GMAC, %s on %s\n",
                  options.preset.c_str(), options.size, median_ms, p95_ms, result->info.gmac,
                  nn::ToString(result->info.family), device->Info().name.c_str());
    return PrintText(text);
  }
  Json report = NewReport("bench_net");
  report["preset"] = options.preset;
  report["size"] = options.size;
  report["median_ms"] = Rounded(median_ms, 4);
  report["p95_ms"] = Rounded(p95_ms, 4);
  report["gmac"] = Rounded(result->info.gmac, 6);
  report["device"] = device->Info().name;
  report["driver"] = device->Info().driver_info;
  report["family"] = nn::ToString(result->info.family);
  report["frames"] = result->frame_ms.size();
  report["dispatches"] = result->info.num_dispatches;
  report["weight_bytes"] = result->info.weight_bytes;
  report["activation_bytes"] = result->info.activation_bytes;
  report["create_ms"] = Rounded(result->create_ms, 3);
  report["first_frame_ms"] = Rounded(result->first_frame_ms, 3);
  if (options.layers) {
    report["layers"] = Json::array();
    for (const gpu::StageTime& layer : result->layers) {
      const double ms = 1e-6 * static_cast<double>(layer.duration_ns);
      report["layers"].push_back(Json{{"name", layer.name}, {"ms", Rounded(ms, 4)}});
    }
  }
  return PrintJson(report);
}

}  // namespace

void AddBenchNet(CLI::App& bench, PendingRun& pending) {
  AddCommand<BenchNetOptions>(
      bench, pending, "net", "Time a network (random weights) on a device",
      [](CLI::App& command, BenchNetOptions& options) {
        command.add_option("--preset", options.preset, "nano, mobile, standard or paper")
            ->capture_default_str();
        command
            .add_option("--size", options.size, "Width and height of the input, a multiple of 64")
            ->capture_default_str();
        BindDeviceOption(command, options.device);
        command.add_option("--family", options.family, "Kernels: auto, cpu-simd or gpu")
            ->check(CLI::IsMember({"auto", "cpu-simd", "gpu"}))
            ->capture_default_str();
        command.add_option("--frames", options.frames, "Timed frames")
            ->check(CLI::Range(1, 1000000))
            ->capture_default_str();
        command.add_flag("--layers", options.layers, "Also time every layer (in the JSON)");
        command.add_flag("--json", options.json, "Print {median_ms, p95_ms, gmac, device, ..}");
        command.footer("Example:\n  plumbline bench net --preset nano --size 320 --json");
      },
      RunBenchNet);
}

}  // namespace plumb::tools
