// Recorded GPU work that can be submitted again and again.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/gpu/device.h"

namespace plumb::gpu {

enum class WaitResult { kDone, kTimeout };

struct StageTime {
  std::string name;
  int64_t duration_ns = 0;
};

/// Made by Recorder::Finish(). Buffers and kernels that it uses must outlive it. One thread at a
/// time; at most one submission is in flight.
class CommandList {
 public:
  ~CommandList();  // Waits for the submission in flight.
  CommandList(const CommandList&) = delete;
  CommandList& operator=(const CommandList&) = delete;

  /// Starts the work and returns at once.
  /// @return kInvalidArgument when a submission is in flight; kDeviceLost.
  Status Submit();

  /// Waits for the submission in flight; kDone at once if there is none. After kTimeout the work
  /// is still in flight and Wait() may be called again.
  Result<WaitResult> Wait(std::chrono::nanoseconds timeout);

  /// Submit(), then Wait(); kInternal if `timeout` passes.
  Status Run(std::chrono::nanoseconds timeout = std::chrono::seconds(60));

  bool InFlight() const { return in_flight_; }

  /// GPU time of each stage (Recorder::BeginStage) in the last submission that was waited for, in
  /// order of recording; empty where the device has no timestamps.
  const std::vector<StageTime>& StageTimes() const { return stage_times_; }

 private:
  friend class Recorder;
  struct Resources;  // Command buffer, descriptor sets, views, queries, fence.
  CommandList(std::shared_ptr<Device> device, std::unique_ptr<Resources> resources);
  Status ReadStageTimes();

  std::shared_ptr<Device> device_;
  std::unique_ptr<Resources> resources_;
  std::vector<StageTime> stage_times_;
  std::vector<uint64_t> timestamps_;
  bool in_flight_ = false;
};

}  // namespace plumb::gpu
