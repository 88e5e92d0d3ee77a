// plumbline detect: line segments of image files.
#include <memory>
#include <string>
#include <vector>

#include "plumb/features/segment_refiner.h"
#include "tools/datasets/image_file.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/detector_choice.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"

namespace plumb::tools {
namespace {

struct DetectOptions {
  std::vector<std::string> images;
  DetectorOptions detector;
  bool refined = false;
  bool json = false;
};

Json Describe(const std::string& path, const ImageView& view,
              const std::vector<Segment2>& segments) {
  Json lines = Json::array(), scores = Json::array();
  for (const Segment2& segment : segments) {
    lines.push_back({Rounded(segment.start.x(), 3), Rounded(segment.start.y(), 3),
                     Rounded(segment.end.x(), 3), Rounded(segment.end.y(), 3)});
    scores.push_back(Rounded(segment.score, 6));
  }
  return Json{{"file", path},
              {"width", view.width_px},
              {"height", view.height_px},
              {"lines", std::move(lines)},
              {"scores", std::move(scores)}};
}

Outcome RunDetect(const DetectOptions& options) {
  std::unique_ptr<LineDetector> detector;
  if (Outcome failed = CreateDetector(options.detector, &detector)) return failed;
  SegmentRefiner refiner{SegmentRefinerOptions{}};
  Json report = Json::array();
  {
    ProgressBar progress("detect", options.images.size());
    for (const std::string& path : options.images) {
      if (Outcome interrupted = CheckInterrupt()) return interrupted;
      const Result<cv::Mat> image = ReadColorImage(path);
      if (!image) return FailureFrom(image.error());
      const ImageView view = ViewOf(*image);
      Result<std::vector<Segment2>> segments = detector->Detect(view);
      if (!segments) {
        return Failure{ExitCodeOf(segments.error().code), path + ": " + segments.error().message};
      }
      if (options.refined) segments = refiner.Refine(view, *segments);
      report.push_back(Describe(path, view, *segments));
      progress.Advance();
    }
  }
  if (options.json) return PrintJson(report, JsonLayout::kCompact);
  std::string text;
  for (const Json& image : report) {
    text += image["file"].get<std::string>() + ": " + std::to_string(image["lines"].size()) +
            " segments\n";
  }
  return PrintText(text);
}

}  // namespace

void AddDetect(CLI::App& program, PendingRun& pending) {
  AddCommand<DetectOptions>(
      program, pending, "detect", "Find line segments in images",
      [](CLI::App& command, DetectOptions& options) {
        command.add_option("images", options.images, "Image files")->required();
        options.detector.score_threshold = kCandidateScore;
        BindDetectorOptions(command, options.detector);
        command.add_flag(
            "--refined", options.refined,
            "Move the segments on to the image's edges, as map and refinement use them");
        command.add_flag(
            "--json", options.json,
            "Print [{file, width, height, lines: [[x1, y1, x2, y2], ..], scores}, ..]; "
            "pixels of the image, best score first");
        command.footer(
            "Examples:\n"
            "  plumbline detect photo.jpg --model lsd\n"
            "  plumbline detect a.jpg b.jpg --model nano --json > lines.json\n"
            "  plumbline detect photo.jpg --refined --score-threshold 0.3 --json\n"
            "Without --score-threshold, unlike maps and poses, candidates down to 0.01 are "
            "listed.");
      },
      RunDetect);
}

}  // namespace plumb::tools
