// plumbline eval repeatability: are the same segments found from another viewpoint, and where?
#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "plumb/features/segment_refiner.h"
#include "plumb/features/straighten.h"
#include "tools/datasets/image_file.h"
#include "tools/metrics/percentile.h"
#include "tools/metrics/repeatability.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/detector_choice.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"
#include "tools/plumbline/posed_frames.h"

namespace plumb::tools {
namespace {

constexpr double kMinLengthPx = 12.0;  // shorter segments do not take part

struct EvalRepeatabilityOptions {
  DetectorOptions detector;
  std::string sequence, frames;
  int step = 10;
  bool json = false;
};

enum Processing { kRaw, kRefined, kNumProcessings };
constexpr const char* kProcessingNames[] = {"raw", "refined"};

struct View {
  cv::Mat depth;
  std::array<std::vector<Segment2>, kNumProcessings> segments;
};

/// One processing's figures over all pairs and views.
struct Figures {
  RepeatabilityTally tally;
  std::vector<double> counts, lengths_px;  // per view, per segment
};

/// Detects each frame once, however many pairs it belongs to.
class Evaluation {
 public:
  Evaluation(TumSequence sequence, LineDetector* detector)
      : sequence_(std::move(sequence)), detector_(detector), refiner_(SegmentRefinerOptions{}) {}

  Outcome AddPairOf(size_t first, size_t second) {
    for (const size_t index : {first, second}) {
      if (Outcome failed = Load(index)) return failed;
    }
    for (int kind = 0; kind < kNumProcessings; ++kind) {
      AddPair(sequence_.rectifier, At(first, kind), At(second, kind), &figures_[kind].tally);
    }
    views_.erase(views_.begin(), views_.upper_bound(first));
    return std::nullopt;
  }

  const Figures& Of(int kind) const { return figures_[kind]; }

 private:
  Outcome Load(size_t index) {
    if (views_.contains(index)) return std::nullopt;
    RgbdImages images;
    if (Outcome failed = ReadRgbdImages(sequence_.frames[index],
                                        sequence_.rectifier.image_camera().pinhole, &images)) {
      return failed;
    }
    const ImageView image = ViewOf(images.color);
    Result<std::vector<Segment2>> raw = detector_->Detect(image);
    if (!raw) return FailureFrom(raw.error());
    View& view = views_[index];
    view.depth = images.depth;
    view.segments[kRefined] = refiner_.Refine(image, *raw, &sequence_.rectifier);
    view.segments[kRaw] = StraightenSegments(sequence_.rectifier, *std::move(raw));
    std::erase_if(view.segments[kRaw],
                  [](const Segment2& segment) { return segment.Length() <= kMinLengthPx; });
    for (int kind = 0; kind < kNumProcessings; ++kind) {
      figures_[kind].counts.push_back(static_cast<double>(view.segments[kind].size()));
      for (const Segment2& segment : view.segments[kind]) {
        figures_[kind].lengths_px.push_back(segment.Length());
      }
    }
    return std::nullopt;
  }

  RepeatabilityView At(size_t index, int kind) const {
    const View& view = views_.at(index);
    return {*sequence_.frames[index].cam_from_world, ViewOfDepth(view.depth, sequence_.depth_scale),
            view.segments[kind]};
  }

  TumSequence sequence_;
  LineDetector* detector_;
  SegmentRefiner refiner_;
  std::map<size_t, View> views_;  // by index in the sequence
  std::array<Figures, kNumProcessings> figures_;
};

/// Pairs (frame of the list, the sequence's frame `step` later), by index in the sequence.
Outcome SelectPairs(const EvalRepeatabilityOptions& options, TumSequence* out_sequence,
                    std::vector<size_t>* out_firsts) {
  std::vector<SequenceFrame> listed;
  if (Outcome failed =
          SelectPosedFrames(options.sequence, options.frames, true, out_sequence, &listed)) {
    return failed;
  }
  const auto step = static_cast<size_t>(options.step);
  std::vector<SequenceFrame> partners;
  for (const SequenceFrame& frame : listed) {
    const auto at = std::ranges::lower_bound(out_sequence->frames, frame.timestamp_ns, {},
                                             &SequenceFrame::timestamp_ns);
    const auto first = static_cast<size_t>(at - out_sequence->frames.begin());
    if (first + step >= out_sequence->frames.size()) continue;
    out_firsts->push_back(first);
    partners.push_back(out_sequence->frames[first + step]);
  }
  if (out_firsts->empty()) {
    return Failure{kExitBadData, options.frames + ": no frame of it has one " +
                                     std::to_string(step) + " later in the sequence"};
  }
  std::ranges::sort(*out_firsts);
  return CheckPosed(options.sequence, partners, true);
}

Json Describe(const Figures& figures) {
  return Json{{"segments_per_view", Rounded(Percentile(figures.counts, 50.0), 1)},
              {"length_px", Rounded(Percentile(figures.lengths_px, 50.0), 2)},
              {"expected", figures.tally.num_expected},
              {"found_again", Rounded(figures.tally.FoundShare(), 4)},
              {"error_px",
               {{"median", Rounded(Percentile(figures.tally.errors_px, 50.0), 4)},
                {"p90", Rounded(Percentile(figures.tally.errors_px, 90.0), 4)}}}};
}

std::string DescribeInWords(const char* name, const Figures& figures) {
  char text[200];
  std::snprintf(text, sizeof(text),
                "%-8s %4.0f segments a view, %3.0f px; found again %.1f %% of %zu, "
                "off by %.2f px, p90 %.2f px\n",
                name, Percentile(figures.counts, 50.0), Percentile(figures.lengths_px, 50.0),
                100.0 * figures.tally.FoundShare(), figures.tally.num_expected,
                Percentile(figures.tally.errors_px, 50.0),
                Percentile(figures.tally.errors_px, 90.0));
  return text;
}

Outcome RunEvalRepeatability(const EvalRepeatabilityOptions& options) {
  TumSequence sequence;
  std::vector<size_t> firsts;
  if (Outcome failed = SelectPairs(options, &sequence, &firsts)) return failed;
  std::unique_ptr<LineDetector> detector;
  if (Outcome failed = CreateDetector(options.detector, &detector)) return failed;
  Evaluation evaluation(std::move(sequence), detector.get());
  {
    ProgressBar progress("eval repeatability", firsts.size());
    for (const size_t first : firsts) {
      if (Outcome interrupted = CheckInterrupt()) return interrupted;
      const size_t second = first + static_cast<size_t>(options.step);
      if (Outcome failed = evaluation.AddPairOf(first, second)) return failed;
      progress.Advance();
    }
  }
  if (!options.json) {
    std::string text;
    for (int kind = 0; kind < kNumProcessings; ++kind) {
      text += DescribeInWords(kProcessingNames[kind], evaluation.Of(kind));
    }
    return PrintText(text);
  }
  Json report = NewReport("eval_repeatability");
  report["model"] = detector->Name();
  report["pairs"] = firsts.size();
  report["step"] = options.step;
  for (int kind = 0; kind < kNumProcessings; ++kind) {
    report[kProcessingNames[kind]] = Describe(evaluation.Of(kind));
  }
  return PrintJson(report);
}

}  // namespace

void AddEvalRepeatability(CLI::App& eval, PendingRun& pending) {
  AddCommand<EvalRepeatabilityOptions>(
      eval, pending, "repeatability",
      "Score how many segments a detector finds again from another viewpoint, and how exactly",
      [](CLI::App& command, EvalRepeatabilityOptions& options) {
        command
            .add_option("--sequence", options.sequence, "Posed RGB-D sequence in the TUM layout")
            ->required();
        command
            .add_option("--frames", options.frames,
                        "Timestamps, one a line: the first view of each pair")
            ->required();
        command.add_option("--step", options.step, "The second view is so many frames later")
            ->check(CLI::Range(1, 1000000))
            ->capture_default_str();
        BindDetectorOptions(command, options.detector);
        command.add_flag("--json", options.json,
                         "Print {pairs, raw: {segments_per_view, length_px, expected, "
                         "found_again, error_px: {median, p90}}, refined: the same}");
        command.footer(
            "Segments longer than 12 px take part, raw and as map and refinement use them.\n"
            "Example:\n"
            "  plumbline eval repeatability --sequence DIR --frames map.txt --model nano --json");
      },
      RunEvalRepeatability);
}

}  // namespace plumb::tools
