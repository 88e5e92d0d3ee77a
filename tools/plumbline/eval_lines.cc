// plumbline eval lines: structural average precision of a detector on annotated images.
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "tools/datasets/image_file.h"
#include "tools/datasets/line_annotations.h"
#include "tools/metrics/percentile.h"
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
  bool json = false;
};

Outcome RunEvalLines(const EvalLinesOptions& options) {
  const Result<std::vector<AnnotatedImage>> annotated =
      ReadLineAnnotations(options.data, options.images);
  if (!annotated) return FailureFrom(annotated.error());
  std::unique_ptr<LineDetector> detector;
  if (Outcome failed = CreateDetector(options.detector, &detector)) return failed;
  std::vector<LineEvaluation> evaluations;
  std::vector<double> detect_ms;
  {
    ProgressBar progress("eval lines", (*annotated).size());
    for (const AnnotatedImage& entry : *annotated) {
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
      detect_ms.push_back(
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
              .count());
      evaluations.push_back({view.width_px, view.height_px, *std::move(segments), entry.lines});
      progress.Advance();
    }
  }
  const double ap[] = {StructuralAp(evaluations, 5.0), StructuralAp(evaluations, 10.0),
                       StructuralAp(evaluations, 15.0)};
  // The first image pays for what later ones find ready: the median is what an image costs.
  const double ms_per_image = Percentile(detect_ms, 50.0);
  if (!options.json) {
    char text[160];
    std::snprintf(text, sizeof(text),
                  "sAP5 %.1f  sAP10 %.1f  sAP15 %.1f  (%zu images, %.1f ms each)\n", ap[0], ap[1],
                  ap[2], evaluations.size(), ms_per_image);
    return PrintText(text);
  }
  Json report = NewReport("eval_lines");
  report["model"] = detector->Name();
  report["sAP5"] = Rounded(ap[0], 4);
  report["sAP10"] = Rounded(ap[1], 4);
  report["sAP15"] = Rounded(ap[2], 4);
  report["images"] = evaluations.size();
  report["ms_per_image"] = Rounded(ms_per_image, 3);
  return PrintJson(report);
}

}  // namespace

void AddEvalLines(CLI::App& eval, PendingRun& pending) {
  AddCommand<EvalLinesOptions>(
      eval, pending, "lines", "Score a line detector on annotated images (sAP, in percent)",
      [](CLI::App& command, EvalLinesOptions& options) {
        BindDetectorOptions(command, options.detector);
        command
            .add_option(
                "--data", options.data,
                "Directory with images/ and annotations.json [{filename, width, height, lines}]")
            ->required();
        command.add_option("--images", options.images, "Folder of the images below it")
            ->capture_default_str();
        command.add_flag("--json", options.json,
                         "Print {sAP5, sAP10, sAP15, images, ms_per_image}; the time is the median "
                         "of detection alone");
        command.footer("Example:\n  plumbline eval lines --model nano --data wireframe --json");
      },
      RunEvalLines);
}

}  // namespace plumb::tools
