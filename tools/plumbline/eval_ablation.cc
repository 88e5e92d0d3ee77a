// plumbline eval ablation: what features, matching and residual each contribute, frame by frame.
#include <array>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "plumb/features/segment_refiner.h"
#include "plumb/runtime/pose_refiner.h"
#include "plumb/runtime/rectify_points.h"
#include "tools/datasets/image_file.h"
#include "tools/metrics/percentile.h"
#include "tools/metrics/trajectory_error.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/frame_run.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"
#include "tools/plumbline/point_front_end.h"
#include "tools/plumbline/prior_files.h"

namespace plumb::tools {
namespace {

struct EvalAblationOptions {
  FrameRunOptions run;
  std::vector<std::string> priors;  // FILE:CM,DEG
  uint32_t every = 1;
  bool json = false;

  EvalAblationOptions() { run.points = "opencv"; }
};

enum class Features { kPoints, kLines, kJoint };

/// One way to refine a pose.
struct Variant {
  Features features;
  RefineMethod method;
  LineResidual residual;
};
constexpr std::array<Variant, 9> kVariants{{
    // The paper's method has no answer without lines, and points have no line residual.
    {Features::kPoints, RefineMethod::kSearch, LineResidual::kPerpendicular},
    {Features::kLines, RefineMethod::kPaper, LineResidual::kMidpointAngle},
    {Features::kLines, RefineMethod::kPaper, LineResidual::kPerpendicular},
    {Features::kLines, RefineMethod::kSearch, LineResidual::kMidpointAngle},
    {Features::kLines, RefineMethod::kSearch, LineResidual::kPerpendicular},
    {Features::kJoint, RefineMethod::kPaper, LineResidual::kMidpointAngle},
    {Features::kJoint, RefineMethod::kPaper, LineResidual::kPerpendicular},
    {Features::kJoint, RefineMethod::kSearch, LineResidual::kMidpointAngle},
    {Features::kJoint, RefineMethod::kSearch, LineResidual::kPerpendicular},
}};

const char* NameOf(Features features) {
  constexpr const char* kNames[] = {"points", "lines", "joint"};
  return kNames[static_cast<size_t>(features)];
}
const char* MatchingOf(const Variant& variant) {
  if (variant.features == Features::kPoints) return "-";
  return variant.method == RefineMethod::kPaper ? "paper" : "search";
}
const char* ResidualOf(const Variant& variant) {
  if (variant.features == Features::kPoints) return "-";
  return variant.residual == LineResidual::kMidpointAngle ? "midpoint, angle" : "perpendicular";
}

/// The priors of one file.
struct PriorSet {
  std::string size;  // CM,DEG
  std::vector<PosePrior> priors;
};

/// The figures of one variant from the priors of one file.
struct Row {
  std::vector<FrameEvaluation> frames;
  std::vector<double> ms;
  size_t num_refined = 0;
};
using Rows = std::vector<std::array<Row, kVariants.size()>>;  // per PriorSet

/// "FILE:CM,DEG", split at the last colon.
Outcome ReadPriorSet(const std::string& text, const std::vector<SequenceFrame>& frames,
                     PriorSet* out) {
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) {
    return Failure{kExitUsage, "--priors " + text + ": want FILE:CM,DEG"};
  }
  out->size = text.substr(colon + 1);
  return ReadPriors(text.substr(0, colon), out->size, frames, &out->priors);
}

/// Refines every frame in every way from every prior; an image is read and detected once.
class Ablation {
 public:
  Ablation(FrameRun* run, const std::vector<PriorSet>* prior_sets)
      : run_(run),
        prior_sets_(prior_sets),
        rows_(prior_sets->size()),
        segment_refiner_(run->session.segments) {}

  Outcome Open() {
    for (size_t v = 0; v < kVariants.size(); ++v) {
      Result<std::unique_ptr<PoseRefiner>> refiner = PoseRefiner::Create(
          *run_->index, {.method = kVariants[v].method, .residual = kVariants[v].residual});
      if (!refiner) return FailureFrom(refiner.error());
      refiners_[v] = *std::move(refiner);
    }
    return std::nullopt;
  }

  Outcome Add(size_t index) {
    const SequenceFrame& frame = run_->frames[index];
    if (!frame.cam_from_world) {
      return Failure{kExitBadData, frame.color_path + ": has no true pose in groundtruth.txt"};
    }
    const Result<cv::Mat> image = ReadColorImage(frame.color_path);
    if (!image) return FailureFrom(image.error());
    Result<std::vector<Segment2>> segments = DetectRefined(ViewOf(*image), run_->sequence.rectifier,
                                                           run_->detector.get(), &segment_refiner_);
    if (!segments) return FailureFrom(segments.error());
    segments_ = *std::move(segments);
    if (run_->with_points) {
      const Status extracted = point_front_end_.ExtractQuery(*image, run_->sequence.rectifier);
      if (!extracted) return FailureFrom(extracted.error());
    }
    for (size_t p = 0; p < prior_sets_->size(); ++p) {
      if (Outcome failed = AddFrom(p, index)) return failed;
    }
    return std::nullopt;
  }

  const Rows& rows() const { return rows_; }

 private:
  Outcome AddFrom(size_t prior_set, size_t index) {
    const PosePrior& prior = (*prior_sets_)[prior_set].priors[index];
    std::array<std::vector<PointMatch>, 2> points;  // per RefineMethod
    if (run_->with_points) {
      for (const RefineMethod method : {RefineMethod::kSearch, RefineMethod::kPaper}) {
        std::vector<PointMatch>& matches = points[static_cast<size_t>(method)];
        matches = point_front_end_.MatchQuery(run_->sequence.camera, *run_->index,
                                              {&prior.cam_from_world, 1}, method);
        RectifyPoints(run_->sequence.rectifier, &matches);
      }
    }
    for (size_t v = 0; v < kVariants.size(); ++v) {
      const Variant& variant = kVariants[v];
      if (variant.features != Features::kLines && !run_->with_points) continue;
      RefineInput input;
      input.camera = run_->sequence.camera;
      input.prior = prior;
      input.seed = index;
      if (variant.features != Features::kPoints) input.segments = segments_;
      if (variant.features != Features::kLines) {
        input.points = points[static_cast<size_t>(variant.method)];
      }
      if (const Status refined = refiners_[v]->Refine(input, &result_); !refined) {
        return FailureFrom(refined.error());
      }
      Row& row = rows_[prior_set][v];
      row.frames.push_back(
          {*run_->frames[index].cam_from_world, prior.cam_from_world, result_.cam_from_world});
      row.ms.push_back(1e-6 * static_cast<double>(result_.total_ns));
      row.num_refined += result_.status == RefineStatus::kRefined ? 1 : 0;
    }
    return std::nullopt;
  }

  FrameRun* run_;
  const std::vector<PriorSet>* prior_sets_;
  Rows rows_;
  SegmentRefiner segment_refiner_;
  PointFrontEnd point_front_end_;
  std::array<std::unique_ptr<PoseRefiner>, kVariants.size()> refiners_;
  std::vector<Segment2> segments_;
  RefineResult result_;
};

double RefinedShare(const Row& row) {
  return static_cast<double>(row.num_refined) / static_cast<double>(row.frames.size());
}

std::string ToMarkdown(const std::vector<PriorSet>& prior_sets, const Rows& rows) {
  std::string text =
      "| prior | features | matching | residual | median cm / deg | p90 | recall | harmed | "
      "refined "
      "| ms |\n|---|---|---|---|---|---|---|---|---|---|\n";
  for (size_t p = 0; p < rows.size(); ++p) {
    for (size_t v = 0; v < kVariants.size(); ++v) {
      const Row& row = rows[p][v];
      if (row.frames.empty()) continue;
      const TrajectoryEvaluation e = EvaluateTrajectory(row.frames);
      char line[240];
      std::snprintf(line, sizeof(line),
                    "| %s | %s | %s | %s | %.3f / %.4f | %.3f / %.4f | %.1f %% | %.1f %% | "
                    "%.1f %% | %.1f |\n",
                    prior_sets[p].size.c_str(), NameOf(kVariants[v].features),
                    MatchingOf(kVariants[v]), ResidualOf(kVariants[v]), e.refined.median_cm,
                    e.refined.median_deg, e.refined.p90_cm, e.refined.p90_deg,
                    100.0 * e.refined.recall_5cm_5deg, 100.0 * e.harmed, 100.0 * RefinedShare(row),
                    Percentile(row.ms, 50.0));
      text += line;
    }
  }
  return text;
}

Json ToJson(const std::vector<PriorSet>& prior_sets, const Rows& rows) {
  Json list = Json::array();
  for (size_t p = 0; p < rows.size(); ++p) {
    for (size_t v = 0; v < kVariants.size(); ++v) {
      const Row& row = rows[p][v];
      if (row.frames.empty()) continue;
      const TrajectoryEvaluation e = EvaluateTrajectory(row.frames);
      list.push_back(Json{{"prior_size", prior_sets[p].size},
                          {"features", NameOf(kVariants[v].features)},
                          {"matching", MatchingOf(kVariants[v])},
                          {"residual", ResidualOf(kVariants[v])},
                          {"median_cm", Rounded(e.refined.median_cm, 6)},
                          {"median_deg", Rounded(e.refined.median_deg, 6)},
                          {"p90_cm", Rounded(e.refined.p90_cm, 6)},
                          {"p90_deg", Rounded(e.refined.p90_deg, 6)},
                          {"recall_5cm_5deg", Rounded(e.refined.recall_5cm_5deg, 6)},
                          {"harmed", Rounded(e.harmed, 6)},
                          {"refined", Rounded(RefinedShare(row), 6)},
                          {"ms", Rounded(Percentile(row.ms, 50.0), 3)}});
    }
  }
  return list;
}

Outcome RunEvalAblation(const EvalAblationOptions& options) {
  FrameRun run;
  if (Outcome failed = OpenFrameRun(options.run, &run)) return failed;
  std::vector<PriorSet> prior_sets(options.priors.size());
  for (size_t p = 0; p < prior_sets.size(); ++p) {
    if (Outcome failed = ReadPriorSet(options.priors[p], run.frames, &prior_sets[p])) return failed;
  }
  Ablation ablation(&run, &prior_sets);
  if (Outcome failed = ablation.Open()) return failed;
  size_t num_frames = 0;
  {
    ProgressBar progress("eval ablation", run.frames.size());
    for (size_t i = 0; i < run.frames.size(); ++i) {
      progress.Advance();
      if (i % options.every != 0) continue;
      if (Outcome interrupted = CheckInterrupt()) return interrupted;
      if (Outcome failed = ablation.Add(i)) return failed;
      ++num_frames;
    }
  }
  if (!options.json) return PrintText(ToMarkdown(prior_sets, ablation.rows()));
  Json report = NewReport("eval_ablation");
  report["model"] = run.detector_name;
  report["frames"] = num_frames;
  report["rows"] = ToJson(prior_sets, ablation.rows());
  return PrintJson(report);
}

}  // namespace

void AddEvalAblation(CLI::App& eval, PendingRun& pending) {
  AddCommand<EvalAblationOptions>(
      eval, pending, "ablation",
      "Refine with and without points, search and our residual, and compare with the truth",
      [](CLI::App& command, EvalAblationOptions& options) {
        BindRecordingOptions(command, options.run);
        command
            .add_option("--priors", options.priors,
                        "FILE:CM,DEG; coarse poses (TUM format, camera-to-world) and how far off "
                        "they may be; repeatable")
            ->required();
        command.add_option("--every", options.every, "Use every n-th frame only")
            ->check(CLI::Range(1u, 1'000'000u))
            ->capture_default_str();
        command.add_flag("--json", options.json,
                         "Print {model, frames, rows: [{prior_size, features, matching, residual, "
                         "median_cm, ...}]}; else a Markdown table");
        command.footer(
            "Rows: {points, lines, joint} x {the paper's matching, search} x {the paper's "
            "residual, perpendicular}\n"
            "from every prior; --points none leaves out what needs points. ms is matching and "
            "refinement "
            "alone.\n"
            "Example:\n"
            "  plumbline eval ablation --sequence office --frames query.txt --map office.map "
            "--model nano \\\n"
            "      --priors p10.txt:10,2 --priors p40.txt:40,8");
      },
      RunEvalAblation);
}

}  // namespace plumb::tools
