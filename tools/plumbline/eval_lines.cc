// plumbline eval lines: structural and pixel metrics of a detector on annotated images.
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "plumb/base/file.h"
#include "tools/datasets/image_file.h"
#include "tools/datasets/line_annotations.h"
#include "tools/metrics/percentile.h"
#include "tools/metrics/pixel_ap.h"
#include "tools/metrics/structural_ap.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/detector_choice.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

struct EvalLinesOptions {
  DetectorOptions detector;
  std::string data, images = "images";
  std::string detections;  // empty: detect
  std::string curve;       // empty: none
  bool json = false;
};

/// What is scored, and where it came from.
struct Detections {
  std::string model;
  std::vector<LineEvaluation> images;
  std::vector<double> detect_ms;  // none if read from a file
};

Outcome DetectAll(const EvalLinesOptions& options, const std::vector<AnnotatedImage>& annotated,
                  Detections* out) {
  std::unique_ptr<LineDetector> detector;
  if (Outcome failed = CreateDetector(options.detector, &detector)) return failed;
  out->model = detector->Name();
  ProgressBar progress("eval lines", annotated.size());
  for (const AnnotatedImage& entry : annotated) {
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
    const Result<cv::Mat> image = ReadColorImage(entry.path);
    if (!image) return FailureFrom(image.error());
    const ImageView view = ViewOf(*image);
    if (view.width_px != entry.width_px || view.height_px != entry.height_px) {
      return Failure{kExitBadData, entry.path + ": is " + std::to_string(view.width_px) + " x " +
                                       std::to_string(view.height_px) + ", annotated as " +
                                       std::to_string(entry.width_px) + " x " +
                                       std::to_string(entry.height_px)};
    }
    const auto start = std::chrono::steady_clock::now();
    Result<std::vector<Segment2>> segments = detector->Detect(view);
    if (!segments) return FailureFrom(segments.error());
    out->detect_ms.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    out->images.push_back({view.width_px, view.height_px, *std::move(segments), entry.lines});
    progress.Advance();
  }
  return std::nullopt;
}

Outcome ReadAll(const EvalLinesOptions& options, const std::vector<AnnotatedImage>& annotated,
                Detections* out) {
  Result<std::vector<std::vector<Segment2>>> read = ReadDetections(options.detections, annotated);
  if (!read) return FailureFrom(read.error());
  out->model = options.detections;
  for (size_t i = 0; i < annotated.size(); ++i) {
    out->images.push_back(
        {annotated[i].width_px, annotated[i].height_px, std::move((*read)[i]), annotated[i].lines});
  }
  return std::nullopt;
}

Outcome WriteCurve(const std::string& path, const std::vector<LineEvaluation>& images) {
  std::string text = "threshold,precision,recall,F\n";
  for (const OperatingPoint& point : StructuralCurve(images, 10.0)) {
    char line[80];
    std::snprintf(line, sizeof(line), "%.2f,%.4f,%.4f,%.4f\n", point.min_score, point.precision,
                  point.recall, point.f);
    text += line;
  }
  const Status written = WriteFileAtomically(path, text);
  if (written) return std::nullopt;
  Failure failure = FailureToWrite(written.error());
  failure.message.insert(0, "--curve " + path + ": ");
  return failure;
}

Outcome PrintScores(const EvalLinesOptions& options, const Detections& detections) {
  const std::vector<LineEvaluation>& images = detections.images;
  const double ap[] = {StructuralAp(images, 5.0), StructuralAp(images, 10.0),
                       StructuralAp(images, 15.0)};
  const PixelScores pixels = EvaluatePixels(images);
  // The first image pays for what later ones find ready: the median is what an image costs.
  const double ms_per_image = Percentile(detections.detect_ms, 50.0);
  if (!options.json) {
    char text[160];
    std::snprintf(text, sizeof(text),
                  "sAP5 %.1f  sAP10 %.1f  sAP15 %.1f  FH %.1f  APH %.1f  (%zu images", ap[0], ap[1],
                  ap[2], pixels.f_percent, pixels.ap_percent, images.size());
    std::string line = text;
    if (!detections.detect_ms.empty()) {
      std::snprintf(text, sizeof(text), ", %.1f ms each", ms_per_image);
      line += text;
    }
    return PrintText(line + ")\n");
  }
  Json report = NewReport("eval_lines");
  report["model"] = detections.model;
  report["sAP5"] = Rounded(ap[0], 4);
  report["sAP10"] = Rounded(ap[1], 4);
  report["sAP15"] = Rounded(ap[2], 4);
  report["FH"] = Rounded(pixels.f_percent, 4);
  report["APH"] = Rounded(pixels.ap_percent, 4);
  report["images"] = images.size();
  report["ms_per_image"] = Rounded(ms_per_image, 3);
  return PrintJson(report);
}

Outcome RunEvalLines(const EvalLinesOptions& options) {
  const Result<std::vector<AnnotatedImage>> annotated =
      ReadLineAnnotations(options.data, options.images);
  if (!annotated) return FailureFrom(annotated.error());
  Detections detections;
  if (Outcome failed = options.detections.empty() ? DetectAll(options, *annotated, &detections)
                                                  : ReadAll(options, *annotated, &detections)) {
    return failed;
  }
  // The scores first: they took long, and a curve that cannot be written must not lose them.
  if (Outcome failed = PrintScores(options, detections)) return failed;
  return options.curve.empty() ? Outcome() : WriteCurve(options.curve, detections.images);
}

}  // namespace

void AddEvalLines(CLI::App& eval, PendingRun& pending) {
  AddCommand<EvalLinesOptions>(
      eval, pending, "lines",
      "Score a line detector on annotated images (sAP, F^H and AP^H, in percent)",
      [](CLI::App& command, EvalLinesOptions& options) {
        options.detector.score_threshold = kCandidateScore;
        BindDetectorOptions(command, options.detector);
        command
            .add_option(
                "--data", options.data,
                "Directory with images/ and annotations.json [{filename, width, height, lines}]")
            ->required();
        command.add_option("--images", options.images, "Folder of the images below it")
            ->capture_default_str();
        command
            .add_option("--detections", options.detections,
                        "Score the segments of this file, as detect --json prints them, instead")
            ->excludes("--model");
        command.add_option("--curve", options.curve,
                           "Also write CSV: threshold, precision, recall, F of the sAP10 hits");
        command.add_flag("--json", options.json,
                         "Print {sAP5, sAP10, sAP15, FH, APH, images, ms_per_image}; the time is "
                         "the median of detection alone");
        command.footer(
            "Examples:\n"
            "  plumbline eval lines --model nano --data wireframe --json\n"
            "  plumbline eval lines --detections lines.json --data wireframe --curve curve.csv");
      },
      RunEvalLines);
}

}  // namespace plumb::tools
