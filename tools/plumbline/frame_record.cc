// What replay and bench frame write about a frame and about all frames.
#include "tools/plumbline/frame_record.h"

#include "tools/datasets/timestamp.h"
#include "tools/metrics/percentile.h"

namespace plumb::tools {
namespace {

double Milliseconds(int64_t ns) { return static_cast<double>(ns) * 1e-6; }

Json DescribePose(const Rigid3& cam_from_world) {
  const Rigid3 world_from_cam = cam_from_world.Inverse();
  const Eigen::Vector3d& t = world_from_cam.translation;
  const Eigen::Quaterniond& q = world_from_cam.rotation;
  return Json{{"t", {t.x(), t.y(), t.z()}}, {"q_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
}

Json DescribeTimes(const std::vector<double>& times_ms) {
  Json stage;
  for (const auto& [key, percent] :
       {std::pair("p50", 50.0), std::pair("p90", 90.0), std::pair("p95", 95.0),
        std::pair("p99", 99.0), std::pair("max", 100.0)}) {
    stage[key] = Rounded(Percentile(times_ms, percent), 3);
  }
  return stage;
}

}  // namespace

Json DescribeFrame(const FrameResult& result) {
  const RefineResult& refined = result.refined;
  Json covariance = Json::array();
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column)
      covariance.push_back(refined.covariance(row, column));
  }
  return Json{{"timestamp", FormatTimestamp(result.timestamp_ns)},
              {"status", std::string(ToString(refined.status))},
              {"prior", DescribePose(result.prior.cam_from_world)},
              {"refined", DescribePose(refined.cam_from_world)},
              {"covariance", std::move(covariance)},
              {"observed_directions", refined.num_observed_directions},
              {"segments", result.segments.size()},
              {"matches", refined.matches.size()},
              {"points", refined.num_points_used},
              {"map_support", Rounded(refined.map_support, 5)},
              {"evidence", Rounded(refined.evidence_nats, 3)},
              {"runner_up_ratio", Rounded(refined.runner_up_ratio, 5)},
              {"searched", result.searched},
              {"prior_index", refined.prior_index},
              {"ms",
               {{"detect", Rounded(Milliseconds(result.times.detect_ns), 3)},
                {"ridge", Rounded(Milliseconds(result.times.ridge_ns), 3)},
                {"search", Rounded(Milliseconds(result.times.search_ns), 3)},
                {"match_and_refine", Rounded(Milliseconds(result.times.match_and_refine_ns), 3)},
                {"total", Rounded(Milliseconds(result.times.total_ns), 3)}}}};
}

void FrameStatistics::Add(const FrameResult& result) {
  ++statuses_[std::string(ToString(result.refined.status))];
  const StageTimes& times = result.times;
  wait_ms_.push_back(Milliseconds(times.wait_ns));
  detect_ms_.push_back(Milliseconds(times.detect_ns));
  ridge_ms_.push_back(Milliseconds(times.ridge_ns));
  search_ms_.push_back(Milliseconds(times.search_ns));
  match_and_refine_ms_.push_back(Milliseconds(times.match_and_refine_ns));
  solve_ms_.push_back(Milliseconds(times.search_ns + times.match_and_refine_ns));
  total_ms_.push_back(Milliseconds(times.total_ns));
}

Json FrameStatistics::Stages() const {
  return Json{{"wait", DescribeTimes(wait_ms_)},
              {"detect", DescribeTimes(detect_ms_)},
              {"ridge", DescribeTimes(ridge_ms_)},
              {"search", DescribeTimes(search_ms_)},
              {"match_and_refine", DescribeTimes(match_and_refine_ms_)},
              {"solve", DescribeTimes(solve_ms_)},
              {"total", DescribeTimes(total_ms_)}};
}

}  // namespace plumb::tools
