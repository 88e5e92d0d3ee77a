// plumbline map build: a line map from posed RGB-D key frames.
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "plumb/features/segment_refiner.h"
#include "plumb/map/map_builder.h"
#include "plumb/map/map_file.h"
#include "plumb/runtime/covariance_calibration.h"
#include "tools/datasets/image_file.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/detector_choice.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"
#include "tools/plumbline/output_directory.h"
#include "tools/plumbline/point_front_end.h"
#include "tools/plumbline/posed_frames.h"

namespace plumb::tools {
namespace {

struct MapBuildOptions {
  std::string sequence, frames, out;
  DetectorOptions detector;
  std::string points = "opencv";
  bool calibrate = true;
  bool json = false;
};

/// A key frame with all that its KeyFrameInput borrows.
struct LoadedKeyFrame {
  cv::Mat depth;
  std::vector<Segment2> segments;
  KeyFrameInput input;
};

/// Reads the images of key frames, detects and refines their segments.
class KeyFrameReader {
 public:
  KeyFrameReader(const TumSequence& sequence, LineDetector* detector, bool with_points)
      : sequence_(sequence),
        detector_(detector),
        with_points_(with_points),
        refiner_(SegmentRefinerOptions{}) {}

  Outcome Read(const SequenceFrame& frame, LoadedKeyFrame* out) {
    const Camera& camera = sequence_.camera;
    RgbdImages images;
    const Rectifier& rectifier = sequence_.rectifier;
    if (Outcome failed = ReadRgbdImages(frame, rectifier.image_camera().pinhole, &images)) {
      return failed;
    }
    out->depth = images.depth;

    const ImageView view = ViewOf(images.color);
    const Result<std::vector<Segment2>> raw = detector_->Detect(view);
    if (!raw) return FailureFrom(raw.error());
    out->segments = refiner_.Refine(view, *raw, &rectifier);
    KeyFrameInput& input = out->input;
    input.timestamp_ns = frame.timestamp_ns;
    input.cam_from_world = *frame.cam_from_world;
    input.camera = camera;
    input.rectifier = &rectifier;
    input.segments = out->segments;
    input.depth = ViewOfDepth(out->depth, sequence_.depth_scale);
    if (!with_points_) return std::nullopt;
    Result<std::vector<MapPoint>> points =
        point_front_end_.KeyFramePoints(images.color, rectifier, input.cam_from_world, input.depth);
    if (!points) return FailureFrom(points.error());
    input.points = *std::move(points);
    return std::nullopt;
  }

 private:
  const TumSequence& sequence_;
  LineDetector* detector_;
  bool with_points_;
  SegmentRefiner refiner_;
  PointFrontEnd point_front_end_;
};

/// Fits the map's covariance to what its own key frames show.
void Calibrate(LineMap* map) {
  const CovarianceCalibration calibration = CalibrateCovariance(*map);
  if (calibration.num_errors < kMinCalibrationErrors) {
    PrintRemark("too few key frames see the same place, the covariance stays uncalibrated");
  }
  map->covariance_factor = calibration.factor;
  map->covariance_growth = calibration.growth;
}

Outcome Report(const MapBuildOptions& options, const MapBuildStats& stats, double seconds) {
  if (!options.json) {
    char text[200];
    std::snprintf(text, sizeof(text),
                  "%zu lines (%zu seen by several key frames) from %zu segments of %zu key frames, "
                  "%.1f s\n",
                  stats.num_lines, stats.num_multi_view_lines, stats.num_segments,
                  stats.num_key_frames, seconds);
    return PrintText(options.out + ": " + text);
  }
  Json report = NewReport("map_build");
  report["map"] = options.out;
  report["model"] = options.detector.model;
  report["key_frames"] = stats.num_key_frames;
  report["segments"] = stats.num_segments;
  report["lifted"] = stats.num_lifted;
  report["filtered"] = stats.num_filtered;
  report["lines"] = stats.num_lines;
  report["multi_view_lines"] = stats.num_multi_view_lines;
  report["seconds"] = Rounded(seconds, 3);
  return PrintJson(report);
}

Outcome RunMapBuild(const MapBuildOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  if (Outcome failed = CheckReplaceable(options.out, "manifest.json")) return failed;
  TumSequence sequence;
  std::vector<SequenceFrame> frames;
  if (Outcome failed = SelectPosedFrames(options.sequence, options.frames, &sequence, &frames))
    return failed;
  std::unique_ptr<LineDetector> detector;
  if (Outcome failed = CreateDetector(options.detector, &detector)) return failed;

  MapBuilderOptions builder_options;
  builder_options.detector = detector->Name();
  MapBuilder builder(builder_options);
  {
    KeyFrameReader reader(sequence, detector.get(), options.points == "opencv");
    ProgressBar progress("key frames", frames.size());
    for (const SequenceFrame& frame : frames) {
      if (Outcome interrupted = CheckInterrupt()) return interrupted;
      LoadedKeyFrame loaded;
      if (Outcome failed = reader.Read(frame, &loaded)) return failed;
      if (const Status added = builder.AddKeyFrame(std::move(loaded.input)); !added) {
        return Failure{kExitBadData, added.error().message};
      }
      progress.Advance();
    }
  }
  Result<LineMap> map = [&] {
    ProgressBar progress("fuse lines", 100);
    size_t percent = 0;
    return builder.Build([&](double done) {
      for (; static_cast<double>(percent) < 100.0 * done; ++percent) progress.Advance();
    });
  }();
  if (!map) return FailureFrom(map.error());
  if (options.calibrate) Calibrate(&*map);
  WriteMapOptions write_options;
  write_options.overwrite = true;
  if (const Status written = WriteMap(*map, options.out, write_options); !written) {
    const bool io = written.error().code == ErrorCode::kIoError;
    return Failure{io ? kExitIo : kExitCannotCreate, written.error().message};
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  return Report(options, builder.stats(), seconds.count());
}

}  // namespace

void AddMapBuild(CLI::App& map, PendingRun& pending) {
  AddCommand<MapBuildOptions>(
      map, pending, "build", "Build a line map from posed RGB-D key frames",
      [](CLI::App& command, MapBuildOptions& options) {
        command
            .add_option("--sequence", options.sequence,
                        "Sequence in TUM RGB-D layout with camera.json")
            ->required();
        command
            .add_option("--frames", options.frames, "File with the timestamps of the key frames")
            ->required();
        BindDetectorOptions(command, options.detector);
        command
            .add_option("--out", options.out,
                        "Directory for the map; an earlier map there is replaced")
            ->required();
        command
            .add_option("--points", options.points,
                        "opencv: keep SIFT points of every key frame for replay --points; or none")
            ->check(CLI::IsMember({"none", "opencv"}))
            ->capture_default_str();
        command.add_flag(
            "--calibrate,!--no-calibrate", options.calibrate,
            "Fit the covariance of poses to how well the key frames agree with each other (on by "
            "default)");
        command.add_flag("--json", options.json, "Print what was built as JSON");
        command.footer(
            "Examples:\n"
            "  plumbline map build --sequence office --frames office/map.txt --model nano --out "
            "office.map\n"
            "  plumbline map info office.map");
      },
      RunMapBuild);
}

}  // namespace plumb::tools
