// plumbline eval controls: how often a map is content with segments that are not the frame's own.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "plumb/features/segment_refiner.h"
#include "plumb/runtime/pose_refiner.h"
#include "tools/datasets/image_file.h"
#include "tools/metrics/control_segments.h"
#include "tools/metrics/percentile.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/frame_run.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

// A frame "elsewhere" is so many deviations of the prior away: nearer ones may be found where they
// really are, which would be right.
constexpr double kElsewhereDeviations = 5.0;

struct EvalControlsOptions {
  FrameRunOptions run;
  uint32_t every = 1;
  bool json = false;

  EvalControlsOptions() { run.mode = "independent"; }
};

enum Control { kOwn, kElsewhere, kMirrored, kRandom, kNumControls };
constexpr const char* kControlNames[] = {"own", "elsewhere", "mirrored", "random"};

struct Tally {
  size_t num_frames = 0;
  std::map<std::string, size_t> statuses;
  std::vector<double> evidence_nats;

  double RefinedShare() const {
    const auto refined = statuses.find("REFINED");
    if (num_frames == 0 || refined == statuses.end()) return 0.0;
    return static_cast<double>(refined->second) / static_cast<double>(num_frames);
  }
};
using Tallies = std::array<Tally, kNumControls>;

Outcome DetectAll(FrameRun* run, std::vector<std::vector<Segment2>>* out_segments) {
  SegmentRefiner refiner(run->session.segments);
  ProgressBar progress("detect", run->frames.size());
  for (const SequenceFrame& frame : run->frames) {
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
    const Result<cv::Mat> image = ReadColorImage(frame.color_path);
    if (!image) return FailureFrom(image.error());
    Result<std::vector<Segment2>> segments =
        DetectRefined(ViewOf(*image), run->sequence.rectifier, run->detector.get(), &refiner);
    if (!segments) return FailureFrom(segments.error());
    out_segments->push_back(*std::move(segments));
    progress.Advance();
  }
  return std::nullopt;
}

bool IsElsewhere(const Rigid3& cam_from_world, const PosePrior& prior) {
  const PoseDistance distance = DistanceBetween(cam_from_world, prior.cam_from_world);
  return distance.position_m > kElsewhereDeviations * prior.position_sigma_m ||
         distance.rotation_rad > kElsewhereDeviations * prior.rotation_sigma_rad;
}

/// The first frame, from half of the run on, whose prior is elsewhere than all priors of `index`.
std::optional<size_t> FrameElsewhere(const FrameRun& run, size_t index) {
  const std::span<const PosePrior> more = run.MorePriors(index);
  const size_t count = run.priors.size();
  for (size_t step = 0; step < count; ++step) {
    const size_t other = (index + count / 2 + step) % count;
    const Rigid3& pose = run.priors[other].cam_from_world;
    const auto is_elsewhere = [&](const PosePrior& prior) { return IsElsewhere(pose, prior); };
    if (is_elsewhere(run.priors[index]) && std::all_of(more.begin(), more.end(), is_elsewhere)) {
      return other;
    }
  }
  return std::nullopt;
}

std::optional<std::vector<Segment2>> SegmentsOf(Control control, const FrameRun& run,
                                                const std::vector<std::vector<Segment2>>& segments,
                                                size_t index) {
  const Camera& camera = run.sequence.camera;
  switch (control) {
    case kElsewhere: {
      const auto other = FrameElsewhere(run, index);
      return other ? std::optional(segments[*other]) : std::nullopt;
    }
    case kMirrored:
      return MirrorSegments(segments[index], camera.width_px);
    case kRandom:
      return ScatterSegments(segments[index], camera.width_px, camera.height_px, index);
    default:
      return segments[index];
  }
}

Outcome RefineAll(const FrameRun& run, const std::vector<std::vector<Segment2>>& segments,
                  uint32_t every, Tallies* out_tallies) {
  const Result<std::unique_ptr<PoseRefiner>> refiner =
      PoseRefiner::Create(*run.index, run.session.refiner);
  if (!refiner) return FailureFrom(refiner.error());
  ProgressBar progress("refine", run.frames.size());
  RefineResult result;
  for (size_t i = 0; i < run.frames.size(); ++i) {
    progress.Advance();
    if (i % every != 0) continue;
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
    for (const Control control : {kOwn, kElsewhere, kMirrored, kRandom}) {
      const auto chosen = SegmentsOf(control, run, segments, i);
      if (!chosen) continue;
      RefineInput input;
      input.camera = run.sequence.camera;
      input.segments = *chosen;
      input.prior = run.priors[i];
      input.more_priors = run.MorePriors(i);
      input.seed = i;
      if (const Status refined = (*refiner)->Refine(input, &result); !refined) {
        return FailureFrom(refined.error());
      }
      Tally& tally = (*out_tallies)[control];
      ++tally.num_frames;
      ++tally.statuses[std::string(ToString(result.status))];
      tally.evidence_nats.push_back(result.evidence_nats);
    }
  }
  return std::nullopt;
}

std::string ToText(const Tallies& tallies) {
  std::string text = "segments    frames   refined   evidence: median  largest\n";
  for (int control = 0; control < kNumControls; ++control) {
    const Tally& tally = tallies[static_cast<size_t>(control)];
    if (tally.num_frames == 0) continue;
    char line[120];
    std::snprintf(line, sizeof(line), "%-10s %7zu %8.1f %%  %16.1f %8.1f\n", kControlNames[control],
                  tally.num_frames, 100.0 * tally.RefinedShare(),
                  Percentile(tally.evidence_nats, 50.0), Percentile(tally.evidence_nats, 100.0));
    text += line;
  }
  return text;
}

Outcome RunEvalControls(const EvalControlsOptions& options) {
  FrameRun run;
  if (Outcome failed = OpenFrameRun(options.run, &run)) return failed;
  std::vector<std::vector<Segment2>> segments;
  if (Outcome failed = DetectAll(&run, &segments)) return failed;
  Tallies tallies;
  if (Outcome failed = RefineAll(run, segments, options.every, &tallies)) return failed;
  if (!options.json) return PrintText(ToText(tallies));
  Json report = NewReport("eval_controls");
  for (int control = 0; control < kNumControls; ++control) {
    const Tally& tally = tallies[static_cast<size_t>(control)];
    Json entry{{"frames", tally.num_frames},
               {"refined", Rounded(tally.RefinedShare(), 6)},
               {"status", tally.statuses}};
    if (tally.num_frames > 0) {
      entry["evidence_median"] = Rounded(Percentile(tally.evidence_nats, 50.0), 3);
      entry["evidence_largest"] = Rounded(Percentile(tally.evidence_nats, 100.0), 3);
    }
    report[kControlNames[control]] = std::move(entry);
  }
  return PrintJson(report);
}

}  // namespace

void AddEvalControls(CLI::App& eval, PendingRun& pending) {
  AddCommand<EvalControlsOptions>(
      eval, pending, "controls", "Count poses that are refined on segments of another place",
      [](CLI::App& command, EvalControlsOptions& options) {
        BindFrameRunOptions(command, options.run);
        command.add_option("--every", options.every, "Use every n-th frame only")
            ->check(CLI::Range(1u, 1'000'000u))
            ->capture_default_str();
        command.add_flag("--json", options.json,
                         "Print {own, elsewhere, mirrored, random}, each {frames, refined, status, "
                         "evidence_median, evidence_largest}; refined is a share, 0..1");
        command.footer(
            "Every frame is refined from its prior four times, independently: with its own "
            "segments, with\n"
            "those of a frame elsewhere (more than 5 times the prior's size away), mirrored, and "
            "at random\n"
            "places. All but the first should never be refined: a share above 0 says that the map "
            "is\n"
            "ambiguous for priors of this size.\n"
            "Example:\n"
            "  plumbline eval controls --sequence office --frames query.txt --priors priors.txt "
            "\\\n"
            "      --map office.map --model nano --prior-size 40,8 --every 5");
      },
      RunEvalControls);
}

}  // namespace plumb::tools
