// plumbline eval trajectory: error of a replay's poses against the truth and against the priors.
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plumb/base/json_depth.h"
#include "tools/datasets/text_file.h"
#include "tools/datasets/timestamp.h"
#include "tools/datasets/trajectory.h"
#include "tools/metrics/normalised_error.h"
#include "tools/metrics/trajectory_error.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

/// Two timestamps within it name the same frame.
constexpr int64_t kSameFrameNs = 1'000'000;

struct EvalTrajectoryOptions {
  std::string run, truth, priors;
  bool json = false;
};

struct MatchedPoses {
  std::vector<FrameEvaluation> frames;
  size_t num_missing = 0;        // priors without a refined pose: count as their prior
  size_t num_without_truth = 0;  // left out
};

MatchedPoses MatchPoses(const Trajectory& truth, const Trajectory& priors,
                        const Trajectory& refined) {
  MatchedPoses matched;
  for (const StampedPose& prior : priors) {
    const auto true_pose = PoseAt(truth, prior.timestamp_ns);
    if (!true_pose) {
      ++matched.num_without_truth;
      continue;
    }
    const StampedPose* pose = NearestPose(refined, prior.timestamp_ns, kSameFrameNs);
    if (pose == nullptr) ++matched.num_missing;
    matched.frames.push_back({*true_pose, prior.cam_from_world,
                              pose != nullptr ? pose->cam_from_world : prior.cam_from_world});
  }
  return matched;
}

/// What RUN/frames.jsonl says.
struct FrameRecords {
  std::map<std::string, size_t> statuses;
  std::map<int64_t, Matrix6d> covariances;  // of the refined frames, by timestamp
};

/// The covariance of a frame that was refined and has one.
std::optional<Matrix6d> CovarianceOf(const Json& frame) {
  const auto values = frame.find("covariance");
  if (frame["status"] != "REFINED" || values == frame.end() || values->size() != 36) {
    return std::nullopt;
  }
  Matrix6d covariance;
  for (int i = 0; i < 36; ++i) {
    const Json& value = (*values)[static_cast<size_t>(i)];
    if (!value.is_number()) return std::nullopt;
    covariance(i / 6, i % 6) = value.get<double>();
  }
  return covariance;
}

Outcome ReadFrameRecords(const std::string& path, FrameRecords* out_records) {
  const Result<std::string> text = ReadFile(path);
  if (!text) return FailureFrom(text.error());
  size_t begin = 0;
  for (int number = 1; begin < (*text).size(); ++number) {
    const size_t end = std::min((*text).find('\n', begin), (*text).size());
    const std::string_view line = std::string_view(*text).substr(begin, end - begin);
    begin = end + 1;
    if (!IsShallowJson(line)) {
      return Failure{kExitBadData, path + ":" + std::to_string(number) + ": is nested too deeply"};
    }
    const Json frame = Json::parse(line, nullptr, false);
    if (!frame.is_object() || !frame.contains("status") || !frame["status"].is_string()) {
      return Failure{kExitBadData,
                     path + ":" + std::to_string(number) + ": is no JSON object with a \"status\""};
    }
    ++out_records->statuses[frame["status"].get<std::string>()];
    const auto covariance = CovarianceOf(frame);
    if (!covariance || !frame.contains("timestamp") || !frame["timestamp"].is_string()) continue;
    const auto timestamp = ParseTimestamp(frame["timestamp"].get<std::string>());
    if (timestamp) out_records->covariances[*timestamp] = *covariance;
  }
  return std::nullopt;
}

NormalisedErrors EvaluateRecords(const FrameRecords& records, const Trajectory& truth,
                                 const Trajectory& refined) {
  std::vector<PoseWithCovariance> frames;
  for (const auto& [timestamp_ns, covariance] : records.covariances) {
    const auto true_pose = PoseAt(truth, timestamp_ns);
    const StampedPose* pose = NearestPose(refined, timestamp_ns, kSameFrameNs);
    if (!true_pose || pose == nullptr) continue;
    frames.push_back({*true_pose, pose->cam_from_world, covariance});
  }
  return EvaluateCovariances(frames);
}

Json Describe(const NormalisedError& error) {
  return Json{{"median", Rounded(error.median, 4)}, {"mean", Rounded(error.mean, 4)}};
}

Json Describe(const ErrorSummary& summary) {
  return Json{{"median_cm", Rounded(summary.median_cm, 6)},
              {"median_deg", Rounded(summary.median_deg, 6)},
              {"p90_cm", Rounded(summary.p90_cm, 6)},
              {"p90_deg", Rounded(summary.p90_deg, 6)},
              {"recall_2cm_2deg", Rounded(summary.recall_2cm_2deg, 6)},
              {"recall_5cm_5deg", Rounded(summary.recall_5cm_5deg, 6)}};
}

std::string ToText(const TrajectoryEvaluation& e, const NormalisedErrors& normalised) {
  char text[600];
  std::snprintf(text, sizeof(text),
                "%zu frames\nprior    median %.2f cm  %.3f deg\n"
                "refined  median %.2f cm  %.3f deg  p90 %.2f cm  %.2f deg\n"
                "below 2 cm and 2 deg %.1f %%, below 5 cm and 5 deg %.1f %%\n"
                "improved %.1f %%, harmed %.1f %%\n"
                "squared error over what the covariance promises: median %.2f (rotation %.2f, "
                "position %.2f), mean %.2f, of %zu refined frames\n",
                e.num_frames, e.prior.median_cm, e.prior.median_deg, e.refined.median_cm,
                e.refined.median_deg, e.refined.p90_cm, e.refined.p90_deg,
                100.0 * e.refined.recall_2cm_2deg, 100.0 * e.refined.recall_5cm_5deg,
                100.0 * e.improved, 100.0 * e.harmed, normalised.pose.median,
                normalised.rotation.median, normalised.position.median, normalised.pose.mean,
                normalised.num_frames);
  return text;
}

Outcome RunEvalTrajectory(const EvalTrajectoryOptions& options) {
  const Result<Trajectory> truth = ReadTumTrajectory(options.truth);
  if (!truth) return FailureFrom(truth.error());
  const Result<Trajectory> priors = ReadTumTrajectory(options.priors);
  if (!priors) return FailureFrom(priors.error());
  const Result<Trajectory> refined = ReadTumTrajectory(options.run + "/trajectory.txt");
  if (!refined) return FailureFrom(refined.error());
  FrameRecords records;
  if (Outcome failed = ReadFrameRecords(options.run + "/frames.jsonl", &records)) return failed;

  const MatchedPoses matched = MatchPoses(*truth, *priors, *refined);
  if (matched.frames.empty()) {
    return Failure{kExitBadData, options.truth + ": holds no pose at the time of any of the " +
                                     std::to_string((*priors).size()) + " priors of " +
                                     options.priors};
  }
  const TrajectoryEvaluation evaluation = EvaluateTrajectory(matched.frames);
  const NormalisedErrors normalised = EvaluateRecords(records, *truth, *refined);
  if (!options.json) return PrintText(ToText(evaluation, normalised));
  Json report = NewReport("eval_trajectory");
  report["frames"] = evaluation.num_frames;
  report["missing"] = matched.num_missing;
  report["without_truth"] = matched.num_without_truth;
  report["prior"] = Describe(evaluation.prior);
  report["refined"] = Describe(evaluation.refined);
  report["improved"] = Rounded(evaluation.improved, 6);
  report["harmed"] = Rounded(evaluation.harmed, 6);
  report["status"] = records.statuses;
  report["normalised_error"] = {{"frames", normalised.num_frames},
                                {"pose", Describe(normalised.pose)},
                                {"rotation", Describe(normalised.rotation)},
                                {"position", Describe(normalised.position)}};
  return PrintJson(report);
}

}  // namespace

void AddEvalTrajectory(CLI::App& eval, PendingRun& pending) {
  AddCommand<EvalTrajectoryOptions>(
      eval, pending, "trajectory", "Score refined poses against the truth and the priors",
      [](CLI::App& command, EvalTrajectoryOptions& options) {
        command.add_option("--run", options.run, "Directory that `plumbline replay` wrote")
            ->required();
        command.add_option("--truth", options.truth, "True poses, TUM format")->required();
        command
            .add_option("--priors", options.priors, "Prior poses, TUM format; these are the frames")
            ->required();
        command.add_flag(
            "--json", options.json,
            "Print {frames, prior, refined, improved, harmed, status, normalised_error}; recalls, "
            "improved "
            "and harmed are shares of the frames, 0..1");
        command.footer(
            "No alignment. A frame without a refined pose counts as its prior. Harmed: worse than "
            "the\n"
            "prior by more than 0.5 cm or 0.1 deg. Squared errors of refined frames are compared "
            "with\n"
            "their covariances: 1 is right, 4 means twice the promised error.\n"
            "Example:\n"
            "  plumbline eval trajectory --run run --truth groundtruth.txt --priors priors.txt "
            "--json");
      },
      RunEvalTrajectory);
}

}  // namespace plumb::tools
