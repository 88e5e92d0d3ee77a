// What replay and bench frame write about a frame and about all frames.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "plumb/runtime/frame_result.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {

/// One line of frames.jsonl, schema plumb.frame/1: poses camera-to-world, covariance of the left
/// perturbation (rotation [rad], translation [m]) of the world-to-camera pose, row by row.
Json DescribeFrame(const FrameResult& result);

/// Collects the times and statuses of frames.
class FrameStatistics {
 public:
  void Add(const FrameResult& result);

  size_t num_frames() const { return total_ms_.size(); }
  /// {"REFINED": 12, ...}
  Json Statuses() const { return statuses_; }
  /// {"detect": {"p50", "p90", "p95", "p99", "max"}, ..} in milliseconds for the stages wait,
  /// detect, ridge, search, match_and_refine, solve (the last two together) and total (from
  /// submission to result).
  Json Stages() const;

 private:
  std::map<std::string, size_t> statuses_;
  std::vector<double> wait_ms_, detect_ms_, ridge_ms_, search_ms_, match_and_refine_ms_, solve_ms_,
      total_ms_;
};

}  // namespace plumb::tools
