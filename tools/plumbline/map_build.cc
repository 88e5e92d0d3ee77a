// plumbline map build: a line map from posed key frames, with depth images or without.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "plumb/features/segment_refiner.h"
#include "plumb/map/map_builder.h"
#include "plumb/map/map_file.h"
#include "plumb/runtime/camera_calibration.h"
#include "plumb/runtime/covariance_calibration.h"
#include "plumb/runtime/pose_adjustment.h"
#include "tools/datasets/image_file.h"
#include "tools/plumbline/commands.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/detector_choice.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/json_report.h"
#include "tools/plumbline/key_frame_source.h"
#include "tools/plumbline/output_directory.h"
#include "tools/plumbline/point_front_end.h"
#include "tools/plumbline/posed_frames.h"
#include "tools/plumbline/prior_files.h"

namespace plumb::tools {
namespace {

constexpr ResultFiles kMapFiles = {kMapManifestName, IsMapFile};

struct MapBuildOptions {
  std::string sequence, frames, colmap, images, out;
  DetectorOptions detector;
  std::string depth;   // empty: both for a sequence, views for a COLMAP model
  std::string points;  // empty: opencv where there is depth
  std::string camera;  // empty: refined for a sequence, given for a COLMAP model
  bool calibrate = true;
  bool adjust_poses = false;
  std::string pose_sigma = "0.5,0.1";  // cm, deg
  bool json = false;

  DepthSource Source() const {
    if (depth.empty()) return colmap.empty() ? DepthSource::kBoth : DepthSource::kViews;
    return *DepthSourceOf(depth);
  }
  bool WithDepth() const { return Source() != DepthSource::kViews; }
  bool RefinesCamera() const { return camera.empty() ? colmap.empty() : camera == "refined"; }
  bool WithPoints() const { return points.empty() ? WithDepth() : points == "opencv"; }
};

/// A key frame with all that its KeyFrameInput borrows.
struct LoadedKeyFrame {
  cv::Mat depth;
  std::vector<Segment2> segments;
  KeyFrameInput input;
};

/// Reads the images of key frames, detects and refines their segments. Detects once however often
/// a frame is read.
class KeyFrameReader {
 public:
  /// `source` may get other rectifiers of the same images on the way.
  KeyFrameReader(const KeyFrameSource& source, LineDetector* detector, bool with_depth)
      : source_(source),
        detector_(detector),
        with_depth_(with_depth),
        refiner_(SegmentRefinerOptions{}),
        detected_(source.frames.size()) {}

  Outcome Read(size_t index, bool with_points, LoadedKeyFrame* out) {
    const SequenceFrame& frame = source_.frames[index];
    const Rectifier& rectifier = source_.rectifiers[source_.rectifier_of[index]];
    RgbdImages images;
    const Camera& taken = rectifier.image_camera().pinhole;
    if (Outcome failed = with_depth_ ? ReadRgbdImages(frame, taken, &images)
                                     : ReadFrameImage(frame, taken, &images.color)) {
      return failed;
    }
    out->depth = images.depth;

    const ImageView image = ViewOf(images.color);
    if (!detected_[index]) {
      Result<std::vector<Segment2>> detected = detector_->Detect(image);
      if (!detected) return FailureFrom(detected.error());
      detected_[index] = *std::move(detected);
    }
    out->segments = refiner_.Refine(image, *detected_[index], &rectifier);
    KeyFrameInput& input = out->input;
    input.timestamp_ns = frame.timestamp_ns;
    input.cam_from_world = *frame.cam_from_world;
    input.camera = rectifier.ideal();
    input.rectifier = &rectifier;
    input.segments = out->segments;
    if (with_depth_) input.depth = ViewOfDepth(out->depth, source_.depth_scale);
    if (!with_points) return std::nullopt;
    Result<std::vector<MapPoint>> points =
        point_front_end_.KeyFramePoints(images.color, rectifier, input.cam_from_world, input.depth);
    if (!points) return FailureFrom(points.error());
    input.points = *std::move(points);
    return std::nullopt;
  }

 private:
  const KeyFrameSource& source_;
  LineDetector* detector_;
  bool with_depth_;
  SegmentRefiner refiner_;
  PointFrontEnd point_front_end_;
  std::vector<std::optional<std::vector<Segment2>>> detected_;  // in the images as taken
};

Outcome AddKeyFrames(const KeyFrameSource& source, const char* label, bool with_points,
                     KeyFrameReader* reader, MapBuilder* builder) {
  ProgressBar progress(label, source.frames.size());
  for (size_t k = 0; k < source.frames.size(); ++k) {
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
    LoadedKeyFrame loaded;
    if (Outcome failed = reader->Read(k, with_points, &loaded)) return failed;
    if (const Status added = builder->AddKeyFrame(std::move(loaded.input)); !added) {
      return Failure{kExitBadData, added.error().message};
    }
    progress.Advance();
  }
  return std::nullopt;
}

/// Corrects the source's camera by what a first map shows, of its depth images alone if it has any.
Outcome RefineCamera(const MapBuildOptions& options, KeyFrameReader* reader, KeyFrameSource* source,
                     std::optional<CameraCorrection>* out_correction) {
  if (!options.RefinesCamera()) return std::nullopt;
  if (source->rectifiers.size() != 1) {
    PrintRemark("--camera refined: the model has " + std::to_string(source->rectifiers.size()) +
                " cameras, they are taken as given");
    return std::nullopt;
  }
  MapBuilderOptions first;
  first.depth_source = options.WithDepth() ? DepthSource::kSensor : DepthSource::kViews;
  MapBuilder builder(first);
  if (Outcome failed = AddKeyFrames(*source, "camera", false, reader, &builder)) return failed;
  const Result<LineMap> map = builder.Build();
  if (!map) return FailureFrom(map.error());
  *out_correction = CalibrateCamera(*map, source->rectifiers[0]);
  if (!*out_correction) return std::nullopt;
  Result<Rectifier> corrected = Rectifier::Create((*out_correction)->corrected);
  if (!corrected) return FailureFrom(corrected.error());
  source->rectifiers[0] = *std::move(corrected);
  return std::nullopt;
}

/// Fits the map's covariance to what its own key frames show: with depth images to what they say
/// each on its own, since depths averaged with other views' agree with those views by construction.
void Calibrate(const MapBuilder& builder, LineMap* map) {
  LineMap apart;
  apart.key_frames = builder.KeyFramesApart();
  const CovarianceCalibration calibration =
      CalibrateCovariance(apart.key_frames.empty() ? *map : apart);
  if (calibration.num_errors < kMinCalibrationErrors) {
    PrintRemark("too few key frames see the same place, the covariance stays uncalibrated");
  }
  map->covariance_factor = calibration.factor;
  map->covariance_growth = calibration.growth;
}

Outcome ReadPoseSigma(const MapBuildOptions& options, BundleOptions* out_options) {
  double cm = 0.0, deg = 0.0;
  if (Outcome failed = ParsePoseSize("--pose-sigma", options.pose_sigma, &cm, &deg)) return failed;
  out_options->position_sigma_m = 0.01 * cm;
  out_options->rotation_sigma_rad = deg * std::numbers::pi / 180.0;
  return std::nullopt;
}

/// Fuses the lines, with adjusted poses where they are asked for.
Result<AdjustedMap> Fuse(const MapBuildOptions& options, const BundleOptions& bundle_options,
                         MapBuilder* builder) {
  ProgressBar bar("fuse lines", 100);
  size_t percent = 0;
  const auto progress = [&](double done) {
    for (; static_cast<double>(percent) < 100.0 * done; ++percent) bar.Advance();
  };
  if (options.adjust_poses) return BuildAdjustedMap(builder, bundle_options, progress);
  Result<LineMap> map = builder->Build(progress);
  if (!map) return map.error();
  return AdjustedMap{*std::move(map)};
}

Outcome Report(const MapBuildOptions& options, const MapBuildStats& stats, const AdjustedMap& built,
               double seconds) {
  const std::optional<PoseChange>& change = built.map.pose_change;
  const double cm = change ? 100.0 * change->position_m : 0.0;
  const double deg = change ? 180.0 / std::numbers::pi * change->rotation_rad : 0.0;
  if (!options.json) {
    char text[200];
    std::snprintf(text, sizeof(text),
                  "%zu lines (%zu seen by several key frames) from %zu segments of %zu key frames, "
                  "%.1f s\n",
                  stats.num_lines, stats.num_multi_view_lines, stats.num_segments,
                  stats.num_key_frames, seconds);
    std::string report = options.out + ": " + text;
    if (options.Source() == DepthSource::kBoth) {
      std::snprintf(
          text, sizeof(text),
          "depth corrected by %.2f %% (median); %zu segments with the mean of depth image "
          "and views\n",
          100.0 * stats.depth_change, stats.num_averaged);
      report += text;
    }
    if (built.map.camera_correction) {
      std::snprintf(text, sizeof(text), "camera corrected by up to %.2f px\n",
                    LargestShiftPx(*built.map.camera_correction));
      report += text;
    }
    if (change) {
      std::snprintf(text, sizeof(text),
                    "poses adjusted by %.2f cm, %.3f deg (median); segments lie %.2f px from their "
                    "lines, before %.2f px\n",
                    cm, deg, built.after_px, built.before_px);
      report += text;
    }
    return PrintText(report);
  }
  Json report = NewReport("map_build");
  report["map"] = options.out;
  report["depth"] = NameOf(options.Source());
  report["model"] = options.detector.model;
  report["key_frames"] = stats.num_key_frames;
  report["segments"] = stats.num_segments;
  report["lifted"] = stats.num_lifted;
  report["averaged"] = stats.num_averaged;
  report["depth_change"] = Rounded(stats.depth_change, 5);
  report["filtered"] = stats.num_filtered;
  report["lines"] = stats.num_lines;
  report["multi_view_lines"] = stats.num_multi_view_lines;
  if (built.map.camera_correction) {
    report["camera_shift_px"] = Rounded(LargestShiftPx(*built.map.camera_correction), 3);
  }
  if (change) {
    report["poses_adjusted_cm"] = Rounded(cm, 3);
    report["poses_adjusted_deg"] = Rounded(deg, 4);
    report["line_distance_before_px"] = Rounded(built.before_px, 3);
    report["line_distance_after_px"] = Rounded(built.after_px, 3);
  }
  report["seconds"] = Rounded(seconds, 3);
  return PrintJson(report);
}

Outcome CheckOptions(const MapBuildOptions& options) {
  const bool from_colmap = !options.colmap.empty() || !options.images.empty();
  const bool complete = from_colmap ? !options.colmap.empty() && !options.images.empty()
                                    : !options.sequence.empty() && !options.frames.empty();
  if (!complete || (from_colmap && !(options.sequence.empty() && options.frames.empty()))) {
    return Failure{kExitUsage, "want either --sequence and --frames or --colmap and --images"};
  }
  if (from_colmap && options.WithDepth()) {
    return Failure{kExitUsage, "--depth " + options.depth +
                                   " needs --sequence: a COLMAP model has no depth images"};
  }
  if (options.WithPoints() && !options.WithDepth()) {
    return Failure{kExitUsage, "--points opencv needs depth images, --depth views has none"};
  }
  if (options.adjust_poses && !options.WithDepth()) {
    return Failure{kExitUsage, "--adjust-poses needs depth images, --depth views has none"};
  }
  return std::nullopt;
}

/// An empty map would replace a good one. One of points alone is fine where they were asked for.
Outcome CheckNotEmpty(const MapBuildOptions& options, const MapBuildStats& stats,
                      const LineMap& map) {
  const auto has_points = [](const KeyFrame& frame) { return !frame.points.empty(); };
  if (!map.lines.empty() ||
      (options.points == "opencv" &&
       std::any_of(map.key_frames.begin(), map.key_frames.end(), has_points))) {
    return std::nullopt;
  }
  const std::string segments = std::to_string(stats.num_segments) + " segments";
  const std::string source = options.colmap.empty() ? options.sequence : options.colmap;
  std::string why = "none of the " + segments;
  if (stats.num_segments == 0) {
    why = "no segment was found in " + std::to_string(stats.num_key_frames) + " key frames";
  } else if (stats.num_lifted == 0) {
    why += " got a depth";
  } else {
    why += " became a line (" + std::to_string(stats.num_lifted) + " got a depth)";
  }
  return Failure{kExitBadData, source + ": " + why + ", no map is written"};
}

Outcome RunMapBuild(const MapBuildOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  if (Outcome wrong = CheckOptions(options)) return wrong;
  BundleOptions bundle_options;
  if (Outcome failed = ReadPoseSigma(options, &bundle_options)) return failed;
  if (Outcome failed = CheckReplaceable(options.out, kMapFiles)) return failed;
  KeyFrameSource source;
  if (Outcome failed =
          options.colmap.empty()
              ? OpenTumKeyFrames(options.sequence, options.frames, options.WithDepth(), &source)
              : OpenColmapKeyFrames(options.colmap, options.images, &source)) {
    return failed;
  }
  std::unique_ptr<LineDetector> detector;
  if (Outcome failed = CreateDetector(options.detector, &detector)) return failed;

  KeyFrameReader reader(source, detector.get(), options.WithDepth());
  std::optional<CameraCorrection> correction;
  if (Outcome failed = RefineCamera(options, &reader, &source, &correction)) return failed;
  MapBuilderOptions builder_options;
  builder_options.detector = detector->Name();
  builder_options.depth_source = options.Source();
  MapBuilder builder(builder_options);
  if (Outcome failed =
          AddKeyFrames(source, "key frames", options.WithPoints(), &reader, &builder)) {
    return failed;
  }
  Result<AdjustedMap> built = Fuse(options, bundle_options, &builder);
  if (!built) return FailureFrom(built.error());
  LineMap& map = built->map;
  map.camera_correction = correction;
  if (options.adjust_poses && !map.pose_change) {
    PrintRemark("no line is seen by two key frames, poses stay as they are");
  }
  if (Outcome empty = CheckNotEmpty(options, builder.stats(), map)) return empty;
  if (options.calibrate) Calibrate(builder, &map);
  WriteMapOptions write_options;
  write_options.overwrite = true;
  if (const Status written = WriteMap(map, PlainPath(options.out), write_options); !written) {
    return FailureToWrite(written.error());
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  return Report(options, builder.stats(), *built, seconds.count());
}

}  // namespace

void AddMapBuild(CLI::App& map, PendingRun& pending) {
  AddCommand<MapBuildOptions>(
      map, pending, "build", "Build a line map from posed key frames",
      [](CLI::App& command, MapBuildOptions& options) {
        command.add_option("--sequence", options.sequence,
                           "Sequence in TUM RGB-D layout with camera.json");
        command.add_option("--frames", options.frames,
                           "File with the timestamps of the sequence's key frames");
        command.add_option("--colmap", options.colmap,
                           "Instead of a sequence: folder of a COLMAP model in metres "
                           "(cameras and images, .bin or .txt)");
        command.add_option("--images", options.images, "Folder of the COLMAP model's images");
        command
            .add_option("--depth", options.depth,
                        "sensor: the sequence's depth images as they are; views: none, lines are "
                        "triangulated from the key frames; both: depth images, corrected by what "
                        "the key frames triangulate (default: both, with --colmap views)")
            ->check(CLI::IsMember({"sensor", "views", "both"}));
        BindDetectorOptions(command, options.detector);
        command
            .add_option("--out", options.out,
                        "Directory for the map; an earlier map there is replaced")
            ->required();
        command
            .add_option("--points", options.points,
                        "opencv: keep SIFT points of every key frame for replay --points; or none "
                        "(default: opencv, with --depth views none)")
            ->check(CLI::IsMember({"none", "opencv"}));
        command
            .add_option("--camera", options.camera,
                        "given: the intrinsics as they are; refined: corrected by what the views "
                        "say, where that holds for key frames left out, and queries of the same "
                        "camera are taken by the corrected ones (default: refined, with --colmap "
                        "given)")
            ->check(CLI::IsMember({"given", "refined"}));
        command.add_flag(
            "--calibrate,!--no-calibrate", options.calibrate,
            "Fit the covariance of poses to how well the key frames agree with each other (on by "
            "default)");
        command.add_flag("--adjust-poses", options.adjust_poses,
                         "Adjust the key frames' poses together with the lines, for poses that are "
                         "known less well than a pixel");
        command
            .add_option("--pose-sigma", options.pose_sigma,
                        "How well the poses are known: deviations in centimetres and degrees, "
                        "CM,DEG")
            ->capture_default_str();
        command.add_flag("--json", options.json, "Print what was built as JSON");
        command.footer(
            "Examples:\n"
            "  plumbline map build --sequence office --frames office/map.txt --model nano --out "
            "office.map\n"
            "  plumbline map build --colmap sparse/0 --images images --model nano --out hall.map\n"
            "  plumbline map info office.map");
      },
      RunMapBuild);
}

}  // namespace plumb::tools
