#include "tools/synth/sequence_writer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "plumb/base/file.h"
#include "plumb/geometry/rectifier.h"
#include "tools/datasets/camera_file.h"
#include "tools/datasets/timestamp.h"
#include "tools/datasets/trajectory.h"
#include "tools/synth/camera_path.h"
#include "tools/synth/curve_chords.h"
#include "tools/synth/render.h"
#include "tools/synth/room.h"

namespace plumb::synth {
namespace {

namespace fs = std::filesystem;
using tools::FormatTimestamp;
using tools::StampedPose;

constexpr double kDepthUnitsPerMetre = 1000.0;
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kMinAnnotatedPx = 8.0;

constexpr std::array<const char*, 3> kFolders = {"rgb/", "depth/", "splits/"};

struct PriorSize {
  const char* name;
  double position_m, rotation_deg;
};
constexpr std::array<PriorSize, 5> kPriorSizes = {{{"p02", 0.02, 0.5},
                                                   {"p05", 0.05, 1.0},
                                                   {"p10", 0.10, 2.0},
                                                   {"p20", 0.20, 4.0},
                                                   {"p40", 0.40, 8.0}}};

Status WriteImage(const fs::path& path, const cv::Mat& image, const std::vector<int>& parameters) {
  try {
    if (cv::imwrite(path.string(), image, parameters)) return Ok();
  } catch (const cv::Exception&) {  // reported like any other failure to write
  }
  return Error{ErrorCode::kInternal, "cannot write " + path.string()};
}

/// Depth in millimetres, 0 where it does not fit.
cv::Mat DepthImage(const RgbdImage& image, double noise, Random random) {
  cv::Mat depth(image.height_px, image.width_px, CV_16U);
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const auto z = static_cast<double>(
          image.depth_m[static_cast<size_t>(y) * static_cast<size_t>(image.width_px) +
                        static_cast<size_t>(x)]);
      const double noisy = noise > 0.0 ? z + noise * z * z * random.Normal() : z;
      const double units = std::round(kDepthUnitsPerMetre * noisy);
      depth.at<uint16_t>(y, x) =
          units > 0.0 && units < 65535.0 ? static_cast<uint16_t>(units) : uint16_t{0};
    }
  }
  return depth;
}

std::string FrameName(int frame, const char* extension) {
  std::array<char, 32> name{};
  std::snprintf(name.data(), name.size(), "%06d.%s", frame, extension);
  return name.data();
}

/// The frames' edges, as 2D annotations and as the set of 3D edges seen so far.
class EdgeRecord {
 public:
  explicit EdgeRecord(const Scene& scene) : edges_(EdgesOf(scene)), seen_(edges_.size(), false) {}

  void Add(const Scene& scene, const Rectifier& rectifier, const Rigid3& pose,
           const std::string& file) {
    const Camera& camera = rectifier.image_camera().pinhole;
    nlohmann::json lines = nlohmann::json::array();
    for (size_t i = 0; i < edges_.size(); ++i) {
      for (const Segment2& part :
           VisibleParts(scene, rectifier.ideal(), pose, edges_[i], kMinAnnotatedPx)) {
        for (const Segment2& chord : ChordsInImage(rectifier, part, kMinAnnotatedPx)) {
          seen_[i] = true;
          nlohmann::json line = nlohmann::json::array();
          for (const double v : {chord.start.x(), chord.start.y(), chord.end.x(), chord.end.y()})
            line.push_back(std::round(100.0 * v) / 100.0);
          lines.push_back(std::move(line));
        }
      }
    }
    annotations_.push_back({{"filename", file},
                            {"width", camera.width_px},
                            {"height", camera.height_px},
                            {"lines", std::move(lines)}});
  }

  std::string AnnotationsJson() const { return annotations_.dump() + "\n"; }

  std::string SeenEdgesText() const {
    std::string text = "# x1 y1 z1 x2 y2 z2 [m]\n";
    std::array<char, 160> line{};
    for (size_t i = 0; i < edges_.size(); ++i) {
      if (!seen_[i]) continue;
      const Eigen::Vector3d &a = edges_[i].start, &b = edges_[i].end;
      std::snprintf(line.data(), line.size(), "%.6f %.6f %.6f %.6f %.6f %.6f\n", a.x(), a.y(),
                    a.z(), b.x(), b.y(), b.z());
      text += line.data();
    }
    return text;
  }

 private:
  std::vector<Segment3> edges_;
  std::vector<bool> seen_;
  nlohmann::json annotations_ = nlohmann::json::array();
};

/// Text files that only need poses: truth, splits and priors.
Status WritePoses(const SequenceOptions& options, const std::vector<StampedPose>& truth,
                  const fs::path& directory) {
  std::string map = "# timestamps of the map frames\n",
              query = "# timestamps of the query frames\n";
  std::vector<StampedPose> queries;
  for (size_t i = 0; i < truth.size(); ++i) {
    const bool is_map = i % static_cast<size_t>(options.map_every) == 0;
    (is_map ? map : query) += FormatTimestamp(truth[i].timestamp_ns) + "\n";
    if (!is_map) queries.push_back(truth[i]);
  }
  const std::string header = "# camera-to-world, OpenCV axes: timestamp tx ty tz qx qy qz qw\n";
  std::vector<std::pair<fs::path, std::string>> files = {
      {directory / "groundtruth.txt", header + tools::FormatTumTrajectory(truth)},
      {directory / "splits" / "map.txt", map},
      {directory / "splits" / "query.txt", query}};

  for (const PriorSize& size : kPriorSizes) {
    Random random(Random::Mix(options.seed) + static_cast<uint64_t>(1e3 * size.position_m));
    std::vector<StampedPose> priors;
    for (const StampedPose& pose : queries) {
      priors.push_back({pose.timestamp_ns, Displace(pose.cam_from_world, size.position_m,
                                                    size.rotation_deg * kDegree, &random)});
    }
    files.emplace_back(directory / "splits" / ("prior_" + std::string(size.name) + ".txt"),
                       header + tools::FormatTumTrajectory(priors));
  }

  Random random(Random::Mix(options.seed) + 9);
  std::vector<Rigid3> true_poses;
  for (const StampedPose& pose : queries) true_poses.push_back(pose.cam_from_world);
  const std::vector<Rigid3> track = DriftingTrack(true_poses, 0.004, 0.1 * kDegree, &random);
  std::vector<StampedPose> drift;
  for (size_t i = 0; i < track.size(); ++i) drift.push_back({queries[i].timestamp_ns, track[i]});
  files.emplace_back(directory / "splits" / "prior_drift.txt",
                     header + tools::FormatTumTrajectory(drift));

  for (const auto& [path, text] : files) {
    if (const Status written = WriteFileAtomically(path, text); !written) return written.error();
  }
  return Ok();
}

}  // namespace

Status SequenceOptions::Validate() const {
  const auto check = [](const char* name, double value, double low, double high) -> Status {
    if (value >= low && value <= high) return Ok();
    return Error{ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(value) +
                                                  ", expected " + std::to_string(low) + " to " +
                                                  std::to_string(high)};
  };
  const std::array checks = {check("num_frames", num_frames, 2, 100000),
                             check("map_every", map_every, 2, 100000),
                             check("width_px", width_px, 64, 4096),
                             check("height_px", height_px, 64, 4096),
                             check("focal_px", focal_px, 1.0, 1e5),
                             check("sweep_deg", sweep_deg, 0.0, 3600.0),
                             check("depth_noise", depth_noise, 0.0, 1.0),
                             check("image_noise", image_noise, 0.0, 255.0),
                             check("samples_per_axis", samples_per_axis, 1, 8)};
  for (const Status& status : checks) {
    if (!status) return status.error();
  }
  return Ok();
}

Status WriteSequence(const SequenceOptions& options, const std::string& directory,
                     const std::function<Status(int, int)>& progress) {
  if (const Status valid = options.Validate(); !valid) return valid.error();
  const fs::path root(directory);
  for (const char* folder : kFolders) {
    std::error_code failure;
    fs::create_directory((root / folder).parent_path(), failure);
    if (failure) return Error{ErrorCode::kInternal, "cannot create " + (root / folder).string()};
  }

  const Scene scene = MakeRoom(options.seed);
  const std::vector<Rigid3> path =
      MakeCameraPath(scene, options.num_frames, options.sweep_deg * kDegree, options.seed);
  Camera camera;
  camera.fx = camera.fy = options.focal_px;
  camera.width_px = options.width_px;
  camera.height_px = options.height_px;
  camera.cx = 0.5 * (options.width_px - 1);
  camera.cy = 0.5 * (options.height_px - 1);

  Result<Rectifier> created = Rectifier::Create({camera, options.lens});
  if (!created) return created.error();
  const Rectifier& rectifier = *created;
  EdgeRecord edges(scene);
  std::vector<StampedPose> truth;
  std::string rgb_list = "# timestamp filename\n", depth_list = rgb_list;
  for (int frame = 0; frame < options.num_frames; ++frame) {
    const Rigid3& pose = path[static_cast<size_t>(frame)];
    RenderOptions render;
    render.samples_per_axis = options.samples_per_axis;
    render.shadows = options.shadows;
    render.noise_grey_levels = options.image_noise;
    render.noise_seed = options.seed * 1000003 + static_cast<uint64_t>(frame);
    RgbdImage image = Render(scene, rectifier, pose, render);

    const std::string rgb = FrameName(frame, options.png ? "png" : "jpg");
    const std::string depth = FrameName(frame, "png");
    const cv::Mat bgr(image.height_px, image.width_px, CV_8UC3, image.bgr.data());
    if (const Status written = WriteImage(root / "rgb" / rgb, bgr, {cv::IMWRITE_JPEG_QUALITY, 92});
        !written)
      return written.error();
    const cv::Mat depth_mm = DepthImage(image, options.depth_noise, Random(render.noise_seed + 1));
    if (const Status written =
            WriteImage(root / "depth" / depth, depth_mm, {cv::IMWRITE_PNG_COMPRESSION, 9});
        !written)
      return written.error();

    truth.push_back({int64_t{frame} * 1000000000 / 30 / 1000 * 1000, pose});  // whole microseconds
    const std::string stamp = FormatTimestamp(truth.back().timestamp_ns);
    rgb_list += stamp + " rgb/" + rgb + "\n";
    depth_list += stamp + " depth/" + depth + "\n";
    edges.Add(scene, rectifier, pose, rgb);
    if (!progress) continue;
    if (const Status go_on = progress(frame + 1, options.num_frames); !go_on) return go_on.error();
  }

  const std::string camera_json =
      tools::FormatCameraFile({rectifier.image_camera(), kDepthUnitsPerMetre},
                              "rendered by plumbline synth, seed " + std::to_string(options.seed));
  for (const auto& [name, text] : {std::pair<const char*, std::string>{"rgb.txt", rgb_list},
                                   {"depth.txt", depth_list},
                                   {"camera.json", camera_json},
                                   {"lines3d.txt", edges.SeenEdgesText()},
                                   {"annotations.json", edges.AnnotationsJson()}}) {
    if (const Status written = WriteFileAtomically(root / name, text); !written)
      return written.error();
  }
  return WritePoses(options, truth, root);
}

bool IsSequenceFile(std::string_view name) {
  const auto is = [&](std::string_view known) { return name == known; };
  if (std::any_of(kFolders.begin(), kFolders.end(), is)) return true;
  constexpr std::array<std::string_view, 9> kFiles = {
      "rgb.txt",         "depth.txt",        "camera.json",
      "groundtruth.txt", "lines3d.txt",      "annotations.json",
      "splits/map.txt",  "splits/query.txt", "splits/prior_drift.txt"};
  if (std::any_of(kFiles.begin(), kFiles.end(), is)) return true;
  for (const PriorSize& size : kPriorSizes) {
    if (name == "splits/prior_" + std::string(size.name) + ".txt") return true;
  }
  // Images have a number of six digits.
  const auto is_image = [&](std::string_view folder, std::string_view ending) {
    return name.size() == folder.size() + 6 + ending.size() && name.starts_with(folder) &&
           name.ends_with(ending) &&
           name.substr(folder.size(), 6).find_first_not_of("0123456789") == name.npos;
  };
  return is_image("rgb/", ".jpg") || is_image("rgb/", ".png") || is_image("depth/", ".png");
}

}  // namespace plumb::synth
