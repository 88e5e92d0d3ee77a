// plumbline replay: refines the poses of a recorded sequence.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "tools/datasets/image_file.h"
#include "tools/datasets/timestamp.h"
#include "tools/datasets/trajectory.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/frame_record.h"
#include "tools/plumbline/frame_run.h"
#include "tools/plumbline/output_directory.h"
#include "tools/plumbline/overlay.h"

namespace plumb::tools {
namespace {

struct ReplayOptions {
  FrameRunOptions run;
  std::string out;
  uint32_t overlays = 6;
  double overlay_brightness = 0.7;
  bool json = false;

  ReplayOptions() { run.mode = "independent"; }
};

constexpr std::string_view kOverlayPrefix = "overlay-", kOverlayEnding = ".png";

bool IsReplayFile(std::string_view name) {
  if (name == "trajectory.txt" || name == "frames.jsonl" || name == "summary.json") return true;
  if (!name.starts_with(kOverlayPrefix) || !name.ends_with(kOverlayEnding)) return false;
  name.remove_prefix(kOverlayPrefix.size());
  name.remove_suffix(kOverlayEnding.size());
  return ParseTimestamp(name).has_value();
}

constexpr ResultFiles kReplayFiles = {"summary.json", IsReplayFile};

/// Whether frame `index` of `num_frames` is one of `count` evenly spaced ones.
bool IsPicked(size_t index, size_t num_frames, size_t count) {
  if (count >= num_frames) return true;
  // Exactly `count` of the values floor(index * count / num_frames) are new.
  return index == 0 ? count > 0 : index * count / num_frames != (index - 1) * count / num_frames;
}

/// Writes what comes out of the session.
class ReplayWriter {
 public:
  ReplayWriter(const FrameRun& run, const ReplayOptions& options, OutputDirectory* out)
      : run_(run), options_(options), out_(out) {}

  Outcome Add(size_t index, const FrameResult& result) {
    trajectory_.push_back({result.timestamp_ns, result.refined.cam_from_world});
    frames_jsonl_ += ToJsonText(DescribeFrame(result), JsonLayout::kCompact);
    statistics_.Add(result);
    if (!IsPicked(index, run_.frames.size(), options_.overlays)) return std::nullopt;
    return WriteOverlay(index, result);
  }

  Outcome Finish(const Json& summary) {
    if (Outcome failed = out_->Write("trajectory.txt", FormatTumTrajectory(trajectory_)))
      return failed;
    if (Outcome failed = out_->Write("frames.jsonl", frames_jsonl_)) return failed;
    return out_->Write("summary.json", ToJsonText(summary));
  }

  const FrameStatistics& statistics() const { return statistics_; }

 private:
  Outcome WriteOverlay(size_t index, const FrameResult& result) {
    const Result<cv::Mat> image = ReadColorImage(run_.frames[index].color_path);
    if (!image) return FailureFrom(image.error());
    const cv::Mat picture = DrawOverlay(*image, options_.overlay_brightness,
                                        run_.sequence.rectifier, *run_.index, result);
    std::vector<uint8_t> png;
    cv::imencode(".png", picture, png);
    const std::string time = FormatTimestamp(result.timestamp_ns);
    return out_->Write(std::string(kOverlayPrefix) + time + std::string(kOverlayEnding),
                       std::string(png.begin(), png.end()));
  }

  const FrameRun& run_;
  const ReplayOptions& options_;
  OutputDirectory* out_;
  Trajectory trajectory_;
  std::string frames_jsonl_;
  FrameStatistics statistics_;
};

Json Summarize(const ReplayOptions& options, const FrameRun& run, const FrameStatistics& statistics,
               double seconds) {
  Json summary = NewReport("replay");
  summary["sequence"] = options.run.sequence;
  summary["map"] = options.run.map;
  summary["model"] = run.detector_name;
  summary["device"] = run.device;
  summary["mode"] = options.run.mode;
  summary["method"] = options.run.method;
  summary["points"] = options.run.points;
  summary["prior_size"] = options.run.prior_size;
  summary["frames"] = statistics.num_frames();
  summary["status"] = statistics.Statuses();
  summary["ms"] = statistics.Stages();
  summary["seconds"] = Rounded(seconds, 3);
  summary["run"] = options.out;
  return summary;
}

std::string ToText(const Json& summary) {
  std::string text =
      summary["run"].get<std::string>() + ": " + summary["frames"].dump() + " frames";
  for (const auto& [status, count] : summary["status"].items())
    text += ", " + count.dump() + " " + status;
  char times[160];
  std::snprintf(
      times, sizeof(times),
      "\nmedian ms: detect %.1f, ridge %.1f, search %.1f, match and refine %.1f; %.1f s in all\n",
      summary["ms"]["detect"]["p50"].get<double>(), summary["ms"]["ridge"]["p50"].get<double>(),
      summary["ms"]["search"]["p50"].get<double>(),
      summary["ms"]["match_and_refine"]["p50"].get<double>(), summary["seconds"].get<double>());
  return text + times;
}

Outcome RunReplay(const ReplayOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  OutputDirectory out;
  if (Outcome failed = CheckReplaceable(options.out, kReplayFiles)) return failed;
  FrameRun run;
  if (Outcome failed = OpenFrameRun(options.run, &run)) return failed;
  if (Outcome failed = out.Open(options.out, kReplayFiles)) return failed;
  ReplayWriter writer(run, options, &out);
  {
    ProgressBar progress("replay", run.frames.size());
    const FrameSink sink = [&](size_t index, const FrameResult& result) {
      progress.Advance();
      return writer.Add(index, result);
    };
    if (Outcome failed = RunFrames(&run, sink)) return failed;
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  const Json summary = Summarize(options, run, writer.statistics(), seconds.count());
  if (Outcome failed = writer.Finish(summary)) return failed;
  if (Outcome failed = out.Commit()) return failed;
  return options.json ? PrintJson(summary) : PrintText(ToText(summary));
}

}  // namespace

void AddReplay(CLI::App& program, PendingRun& pending) {
  AddCommand<ReplayOptions>(
      program, pending, "replay", "Refine the poses of a recorded sequence",
      [](CLI::App& command, ReplayOptions& options) {
        BindFrameRunOptions(command, options.run);
        command
            .add_option(
                "--out", options.out,
                "Directory for trajectory.txt (TUM, camera-to-world), frames.jsonl, summary.json "
                "and overlays; an earlier run there is replaced")
            ->required();
        command.add_option("--overlays", options.overlays, "Number of pictures, evenly spaced")
            ->capture_default_str();
        command
            .add_option("--overlay-brightness", options.overlay_brightness,
                        "Of the camera's image behind the lines: 1 as it is, 0 leaves it out, for "
                        "pictures that may be shown")
            ->check(FiniteRange(0.0, 1.0))
            ->capture_default_str();
        command.add_flag("--json", options.json, "Print the summary as JSON");
        command.footer(
            "Every query frame gives one pose: where no better one was found, its prior.\n"
            "Examples:\n"
            "  plumbline replay --sequence office --frames office/query.txt --priors priors.txt "
            "\\\n"
            "      --map office.map --model nano --out run\n"
            "  plumbline replay ... --mode stream --prior-size 10,2 --json\n"
            "  plumbline eval trajectory --run run --truth office/groundtruth.txt --priors "
            "priors.txt");
      },
      RunReplay);
}

}  // namespace plumb::tools
