// plumbline bench frame: time of whole frames, stage by stage.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

#include "tools/datasets/image_file.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/frame_record.h"
#include "tools/plumbline/frame_run.h"
#include "tools/plumbline/interrupt.h"

namespace plumb::tools {
namespace {

struct BenchFrameOptions {
  FrameRunOptions run;
  size_t limit = 300;
  size_t warm_up = 5;
  bool json = false;

  BenchFrameOptions() { run.mode = "stream"; }
};

/// Decodes the images beforehand: what is timed starts at the camera's image.
Outcome LoadImages(FrameRun* run) {
  ProgressBar progress("load", run->frames.size());
  for (const SequenceFrame& frame : run->frames) {
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
    Result<cv::Mat> image = ReadColorImage(frame.color_path);
    if (!image) return FailureFrom(image.error());
    run->images.push_back(*std::move(image));
    progress.Advance();
  }
  return std::nullopt;
}

Outcome RunBenchFrame(const BenchFrameOptions& options) {
  FrameRun run;
  if (Outcome failed = OpenFrameRun(options.run, &run)) return failed;
  if (run.frames.size() > options.limit) {
    run.frames.resize(options.limit);
    run.priors.resize(options.limit);
  }
  if (run.frames.size() <= options.warm_up) {
    return Failure{kExitUsage, "--warm-up " + std::to_string(options.warm_up) +
                                   ": leaves none of " + std::to_string(run.frames.size()) +
                                   " frames"};
  }
  if (Outcome failed = LoadImages(&run)) return failed;

  using Clock = std::chrono::steady_clock;
  FrameStatistics statistics;
  size_t num_searched = 0;
  Clock::time_point start, end;
  const FrameSink sink = [&](size_t index, const FrameResult& result) -> Outcome {
    end = Clock::now();
    if (index + 1 == options.warm_up) start = end;
    if (index < options.warm_up) return std::nullopt;
    statistics.Add(result);
    if (result.searched) ++num_searched;
    return std::nullopt;
  };
  start = Clock::now();
  if (Outcome failed = RunFrames(&run, sink)) return failed;
  const double seconds = std::chrono::duration<double>(end - start).count();
  const double fps = static_cast<double>(statistics.num_frames()) / seconds;

  const Json stages = statistics.Stages();
  if (!options.json) {
    char line[160];
    std::snprintf(line, sizeof(line), "%zu frames, %.1f frames per second (%s, %s, %s)\n",
                  statistics.num_frames(), fps, run.detector_name.c_str(), run.device.c_str(),
                  options.run.mode.c_str());
    std::string text = line;
    std::snprintf(line, sizeof(line), "%-18s %8s %8s %8s %8s ms\n", "", "p50", "p90", "p95", "p99");
    text += line;
    for (const auto& [stage, ms] : stages.items()) {
      std::snprintf(line, sizeof(line), "%-18s %8.2f %8.2f %8.2f %8.2f\n", stage.c_str(),
                    ms["p50"].get<double>(), ms["p90"].get<double>(), ms["p95"].get<double>(),
                    ms["p99"].get<double>());
      text += line;
    }
    return PrintText(text);
  }
  Json report = NewReport("bench_frame");
  report["model"] = run.detector_name;
  report["device"] = run.device;
  report["mode"] = options.run.mode;
  report["method"] = options.run.method;
  report["points"] = options.run.points;
  report["frames"] = statistics.num_frames();
  report["searched"] = num_searched;
  report["fps"] = Rounded(fps, 3);
  report["ms"] = stages;
  report["status"] = statistics.Statuses();
  return PrintJson(report);
}

}  // namespace

void AddBenchFrame(CLI::App& bench, PendingRun& pending) {
  AddCommand<BenchFrameOptions>(
      bench, pending, "frame", "Time whole frames, stage by stage",
      [](CLI::App& command, BenchFrameOptions& options) {
        BindFrameRunOptions(command, options.run);
        command
            .add_option("--limit", options.limit,
                        "Use at most so many frames; all are kept in memory")
            ->check(CLI::Range(size_t{1}, size_t{100000}))
            ->capture_default_str();
        command.add_option("--warm-up", options.warm_up, "First frames that are not counted")
            ->capture_default_str();
        command.add_flag("--json", options.json,
                         "Print {fps, ms: {STAGE: {p50, p90, p95, p99, max}}, ..}");
        command.footer(
            "Frames follow each other without a pause; the detector works on one while the frame "
            "before\n"
            "is refined. Decoding the image files is not timed. Stages: wait for the detector, "
            "detect,\n"
            "ridge (segments on to the edges), search, match_and_refine, solve (the last two), "
            "total.\n"
            "Example:\n"
            "  plumbline bench frame --map office.map --sequence office --frames office/query.txt "
            "\\\n"
            "      --priors drift.txt --json");
      },
      RunBenchFrame);
}

}  // namespace plumb::tools
