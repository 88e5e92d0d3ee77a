// Times a network on a device.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/gpu/command_list.h"
#include "plumb/nn/network.h"

namespace plumb::nn {

struct NetworkBenchOptions {
  NetworkOptions network;
  int num_frames = 50;        ///< Timed, at least 1.
  int num_warm_up = 5;        ///< Run before, not timed.
  bool times_layers = false;  ///< Also measures every dispatch, in a recording of its own.
};

struct NetworkBenchResult {
  NetworkInfo info;
  double create_ms = 0;                ///< Network::Create().
  double first_frame_ms = 0;           ///< With the driver's compilation.
  std::vector<double> frame_ms;        ///< Submit to done, wall clock, in order.
  std::vector<double> frame_cpu_ms;    ///< CPU time of the whole process in the same intervals.
  std::vector<gpu::StageTime> layers;  ///< Shortest time of each dispatch, if times_layers.
};

/// Runs the network on a fixed random image.
Result<NetworkBenchResult> BenchNetwork(const std::shared_ptr<gpu::Device>& device,
                                        const Model& model,
                                        const NetworkBenchOptions& options = {});

}  // namespace plumb::nn
