// How far refined poses are from the truth, and whether they are better than the priors.
#include "tools/metrics/trajectory_error.h"

#include <numbers>
#include <vector>

#include "tools/metrics/percentile.h"

namespace plumb::tools {
namespace {

constexpr double kHarmedCm = 0.5;
constexpr double kHarmedDeg = 0.1;

struct Errors {
  std::vector<double> cm, deg;

  void Add(const Rigid3& estimate, const Rigid3& truth) {
    const PoseDistance distance = DistanceBetween(estimate, truth);
    cm.push_back(100.0 * distance.position_m);
    deg.push_back(180.0 / std::numbers::pi * distance.rotation_rad);
  }
};

double Recall(const Errors& errors, double max_cm, double max_deg) {
  size_t count = 0;
  for (size_t i = 0; i < errors.cm.size(); ++i) {
    if (errors.cm[i] < max_cm && errors.deg[i] < max_deg) ++count;
  }
  return errors.cm.empty() ? 0.0
                           : static_cast<double>(count) / static_cast<double>(errors.cm.size());
}

ErrorSummary Summarize(const Errors& errors) {
  return {Percentile(errors.cm, 50.0),  Percentile(errors.deg, 50.0), Percentile(errors.cm, 90.0),
          Percentile(errors.deg, 90.0), Recall(errors, 2.0, 2.0),     Recall(errors, 5.0, 5.0)};
}

}  // namespace

TrajectoryEvaluation EvaluateTrajectory(std::span<const FrameEvaluation> frames) {
  Errors prior, refined;
  size_t num_improved = 0, num_harmed = 0;
  for (size_t i = 0; i < frames.size(); ++i) {
    prior.Add(frames[i].prior_cam_from_world, frames[i].true_cam_from_world);
    refined.Add(frames[i].refined_cam_from_world, frames[i].true_cam_from_world);
    const double more_cm = refined.cm[i] - prior.cm[i];
    const double more_deg = refined.deg[i] - prior.deg[i];
    if (more_cm < 0.0 && more_deg < 0.0) ++num_improved;
    if (more_cm > kHarmedCm || more_deg > kHarmedDeg) ++num_harmed;
  }
  TrajectoryEvaluation evaluation;
  evaluation.num_frames = frames.size();
  evaluation.prior = Summarize(prior);
  evaluation.refined = Summarize(refined);
  if (!frames.empty()) {
    const auto count = static_cast<double>(frames.size());
    evaluation.improved = static_cast<double>(num_improved) / count;
    evaluation.harmed = static_cast<double>(num_harmed) / count;
  }
  return evaluation;
}

}  // namespace plumb::tools
