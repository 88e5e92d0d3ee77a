// Runs a recorded sequence through a session: what replay and bench frame share.
#include "tools/plumbline/frame_run.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "plumb/map/map_file.h"
#include "tools/datasets/image_file.h"
#include "tools/datasets/text_file.h"
#include "tools/datasets/timestamp.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/interrupt.h"
#include "tools/plumbline/point_front_end.h"
#include "tools/plumbline/prior_files.h"
#include "tools/plumbline/program.h"

namespace plumb::tools {
namespace {

constexpr int64_t kWaitNs = 1'000'000'000;

/// Finds nothing: what is left of a run without lines are its points.
class NoLines final : public LineDetector {
 public:
  Status Submit(const ImageView&) override { return Ok(); }
  Result<std::vector<Segment2>> Collect() override { return std::vector<Segment2>(); }
  std::string Name() const override { return "none"; }
};

Outcome ChooseDetector(const FrameRunOptions& options, std::unique_ptr<LineDetector>* out) {
  if (options.detector.model != "none") return CreateDetector(options.detector, out);
  if (options.points == "none") {
    return Failure{kExitUsage, "--model none: needs --points opencv, nothing is left otherwise"};
  }
  *out = std::make_unique<NoLines>();
  return std::nullopt;
}

std::optional<Eigen::Vector3d> ParseVector3(std::span<const std::string_view> fields) {
  Eigen::Vector3d v;
  if (fields.size() != 3) return std::nullopt;
  for (int i = 0; i < 3; ++i) {
    const Result<double> number = ParseNumber(fields[static_cast<size_t>(i)]);
    if (!number) return std::nullopt;
    v[i] = *number;
  }
  return v;
}

/// Gives every prior its gravity.
Outcome ReadGravity(const FrameRunOptions& options, FrameRun* run) {
  GravityPrior gravity;
  gravity.sigma_rad = options.gravity_sigma_deg * std::numbers::pi / 180.0;
  const std::vector<DataLine> world = DataLines(options.gravity_in_world);
  const auto down = world.size() == 1 ? ParseVector3(world[0].fields) : std::nullopt;
  if (!down || !(down->norm() > 0.0)) {
    return Failure{kExitUsage,
                   "--gravity-in-world " + options.gravity_in_world + ": want a direction, X,Y,Z"};
  }
  gravity.down_in_world = *down;
  const Result<std::string> text = ReadFile(options.gravity);
  if (!text) return FailureFrom(text.error());
  std::map<int64_t, Eigen::Vector3d> measured;
  for (const DataLine& line : DataLines(*text)) {
    const auto timestamp = ParseTimestamp(line.fields[0]);
    const auto v = ParseVector3(std::span(line.fields).subspan(1));
    if (!timestamp || !v || !(v->norm() > 0.0)) {
      return Failure{kExitBadData,
                     Place(options.gravity, line) + ": want \"timestamp x y z\", not all zero"};
    }
    measured[*timestamp] = *v;
  }
  for (size_t i = 0; i < run->frames.size(); ++i) {
    const int64_t time = run->frames[i].timestamp_ns;
    const auto near = measured.lower_bound(time - kSameFrameNs);
    if (near == measured.end() || near->first > time + kSameFrameNs) {
      return Failure{kExitBadData,
                     options.gravity + ": has no line for frame " + FormatTimestamp(time)};
    }
    gravity.down_in_camera = near->second;
    run->priors[i].gravity = gravity;
    if (run->more_priors.empty()) continue;
    for (PosePrior& prior : run->more_priors[i]) prior.gravity = gravity;
  }
  return std::nullopt;
}

Outcome FailFrame(const SequenceFrame& frame, const Error& error) {
  // A broken frame is bad data; the command line itself has been checked before.
  const ExitCode code =
      error.code == ErrorCode::kInvalidArgument ? kExitBadData : ExitCodeOf(error.code);
  return Failure{code, frame.color_path + ": " + error.message};
}

/// Hands finished results to the sink.
class ResultPump {
 public:
  ResultPump(const FrameRun& run, Session* session, const FrameSink& sink)
      : run_(run), session_(session), sink_(sink) {}

  size_t num_done() const { return num_done_; }

  Outcome TakeFinished() {
    while (session_->Poll(&result_)) {
      if (Outcome failed = Pass()) return failed;
    }
    return std::nullopt;
  }

  Outcome TakeAll(size_t num_submitted) {
    while (num_done_ < num_submitted) {
      if (!session_->Wait(kWaitNs, &result_)) continue;
      if (Outcome failed = Pass()) return failed;
    }
    return std::nullopt;
  }

 private:
  Outcome Pass() {
    const size_t index = num_done_++;
    if (result_.outcome == FrameOutcome::kFailed)
      return FailFrame(run_.frames[index], result_.error);
    return sink_(index, result_);
  }

  const FrameRun& run_;
  Session* session_;
  const FrameSink& sink_;
  FrameResult result_;
  size_t num_done_ = 0;
};

}  // namespace

void BindRecordingOptions(CLI::App& command, FrameRunOptions& options) {
  command
      .add_option("--sequence", options.sequence, "Sequence in TUM RGB-D layout with camera.json")
      ->required();
  command.add_option("--frames", options.frames, "File with the timestamps of the query frames")
      ->required();
  command.add_option("--map", options.map, "Directory that `plumbline map build` wrote")
      ->required();
  BindDetectorOptions(command, options.detector);
  command
      .add_option(
          "--points", options.points,
          "none, or opencv: also SIFT points, matched with those that the map's key frames hold; "
          "points alone with --model none")
      ->check(CLI::IsMember({"none", "opencv"}))
      ->capture_default_str();
}

void BindFrameRunOptions(CLI::App& command, FrameRunOptions& options) {
  BindRecordingOptions(command, options);
  command
      .add_option("--priors", options.priors,
                  "Coarse pose of every query frame, TUM format (camera-to-world)")
      ->required();
  command
      .add_option("--prior-size", options.prior_size,
                  "How far off the priors may be: norms in centimetres and degrees, CM,DEG")
      ->capture_default_str();
  command.add_option(
      "--more-priors", options.more_priors,
      "FILE or FILE:CM,DEG; one more coarse pose of some query frames, for other places "
      "where the camera may be, and how far off (else --prior-size); repeatable");
  command
      .add_option("--gravity", options.gravity,
                  "Gravity of an inertial sensor, a line \"timestamp x y z\" per query frame: the "
                  "direction down in the camera (x right, y down, z forward), of any length")
      ->check(CLI::ExistingFile);
  CLI::Option* in_world = command.add_option("--gravity-in-world", options.gravity_in_world,
                                             "The direction down in the map's world, X,Y,Z");
  in_world->needs("--gravity");
  command.get_option("--gravity")->needs(in_world);
  command
      .add_option("--gravity-sigma", options.gravity_sigma_deg,
                  "Standard deviation of either angle of tilt, degrees")
      ->check(FiniteRange(1e-3, 57.0))
      ->capture_default_str();
  command
      .add_option("--mode", options.mode,
                  "independent: every frame from its own prior; stream: the priors are a tracker's "
                  "poses and the correction is carried from frame to frame")
      ->check(CLI::IsMember({"independent", "stream"}))
      ->capture_default_str();
  command.add_option("--method", options.method, "search, or the paper's local method")
      ->check(CLI::IsMember({"search", "paper"}))
      ->capture_default_str();
}

std::vector<Rigid3> FrameRun::PriorPoses(size_t frame) const {
  std::vector<Rigid3> poses(1, priors[frame].cam_from_world);
  for (const PosePrior& prior : MorePriors(frame)) poses.push_back(prior.cam_from_world);
  return poses;
}

Outcome OpenFrameRun(const FrameRunOptions& options, FrameRun* out_run) {
  Result<TumSequence> sequence = ReadTumSequence(options.sequence);
  if (!sequence) return FailureFrom(sequence.error());
  Result<std::vector<SequenceFrame>> frames = SelectFrames(*sequence, options.frames);
  if (!frames) return FailureFrom(frames.error());
  if (const Status exist = CheckFilesExist(*frames, false); !exist) {
    return FailureFrom(exist.error());
  }
  out_run->sequence = *std::move(sequence);
  out_run->frames = *std::move(frames);
  std::sort(out_run->frames.begin(), out_run->frames.end(),
            [](const SequenceFrame& a, const SequenceFrame& b) {
              return a.timestamp_ns < b.timestamp_ns;
            });
  if (!options.priors.empty()) {
    if (Outcome failed =
            ReadPriors(options.priors, options.prior_size, out_run->frames, &out_run->priors)) {
      return failed;
    }
  }
  if (!options.more_priors.empty()) {
    if (options.method == "paper") {
      return Failure{kExitUsage, "--more-priors: --method paper takes one prior only"};
    }
    if (Outcome failed = ReadMorePriors(options.more_priors, options.prior_size, out_run->frames,
                                        &out_run->more_priors)) {
      return failed;
    }
  }
  if (!options.gravity.empty()) {
    if (Outcome failed = ReadGravity(options, out_run)) return failed;
  }

  Result<LineMap> map = ReadMap(options.map);
  if (!map) return FailureFrom(map.error());
  out_run->map = *std::move(map);
  out_run->index = std::make_unique<MapIndex>(out_run->map);
  Result<Rectifier> rectifier =
      Rectifier::Create(out_run->map.Corrected(out_run->sequence.rectifier.image_camera()));
  if (!rectifier) return FailureFrom(rectifier.error());
  out_run->sequence.rectifier = *std::move(rectifier);
  out_run->sequence.camera = out_run->sequence.rectifier.ideal();
  if (Outcome failed = ChooseDetector(options, &out_run->detector)) return failed;
  out_run->detector_name = out_run->detector->Name();
  out_run->device = out_run->detector->DeviceName();
  if (out_run->detector_name != "none" && out_run->detector_name != out_run->map.detector) {
    PrintRemark(options.map + ": was built with " + out_run->map.detector +
                "'s lines, the queries use " + out_run->detector_name + "'s");
  }
  out_run->with_points = options.points == "opencv";
  const auto has_points = [](const KeyFrame& frame) { return !frame.points.empty(); };
  if (out_run->with_points &&
      std::none_of(out_run->map.key_frames.begin(), out_run->map.key_frames.end(), has_points)) {
    return Failure{kExitBadData, options.map + ": holds no points, --points opencv needs them"};
  }
  SessionOptions& session = out_run->session;
  session.mode = options.mode == "stream" ? SessionMode::kStream : SessionMode::kIndependent;
  session.policy = FramePolicy::kBlock;
  session.refiner.method = options.method == "paper" ? RefineMethod::kPaper : RefineMethod::kSearch;
  return std::nullopt;
}

Outcome RunFrames(FrameRun* run, const FrameSink& sink) {
  Result<std::unique_ptr<Session>> created =
      Session::Create(*run->index, std::move(run->detector), run->session);
  if (!created) return FailureFrom(created.error());
  Session& session = **created;
  ResultPump pump(*run, &session, sink);
  PointFrontEnd point_front_end;
  for (size_t i = 0; i < run->frames.size(); ++i) {
    if (Outcome interrupted = CheckInterrupt()) return interrupted;
    const SequenceFrame& frame = run->frames[i];
    const Result<cv::Mat> image =
        run->images.empty() ? ReadColorImage(frame.color_path) : Result<cv::Mat>(run->images[i]);
    if (!image) return FailureFrom(image.error());
    std::vector<PointMatch> points;
    if (run->with_points) {
      if (const Status found = point_front_end.ExtractQuery(*image, run->sequence.rectifier);
          !found) {
        return FailFrame(frame, found.error());
      }
      points = point_front_end.MatchQuery(run->sequence.camera, *run->index, run->PriorPoses(i),
                                          run->session.refiner.method);
    }
    SessionFrame input;
    input.image = ViewOf(*image);
    input.camera = run->sequence.rectifier.image_camera();
    input.timestamp_ns = frame.timestamp_ns;
    input.prior = run->priors[i];
    input.more_priors = run->MorePriors(i);
    input.points = points;
    const Result<SubmitOutcome> submitted = session.Submit(input);
    if (!submitted) return FailFrame(frame, submitted.error());
    if (Outcome failed = pump.TakeFinished()) return failed;
  }
  return pump.TakeAll(run->frames.size());
}

}  // namespace plumb::tools
