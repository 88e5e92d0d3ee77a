// From the options that every command with a detector has to a line detector.
#include "tools/plumbline/detector_choice.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "plumb/features/configured_detector.h"
#include "plumb/features/detector_factory.h"
#include "plumb/features/vlse_detector.h"
#include "tools/plumbline/console.h"
#include "tools/plumbline/program.h"

namespace plumb::tools {
namespace {

std::vector<std::string> ModelFolders() {
  std::vector<std::string> folders;
  std::error_code code;
  std::filesystem::path place = std::filesystem::read_symlink("/proc/self/exe", code);
  while (!code && place.has_relative_path()) {
    place = place.parent_path();
    for (const char* folder : {"assets/models", "share/plumbline/models"}) {
      if (std::filesystem::is_directory(place / folder, code)) {
        folders.push_back((place / folder).string());
      }
      code.clear();
    }
  }
  return folders;
}

/// "none", "auto" or "CxR".
std::optional<TileGrid> ParseTiles(const std::string& text) {
  if (text == "none") return TileGrid{1, 1};
  if (text == "auto") return TileGrid{0, 0};
  TileGrid grid;
  char end = 0;
  if (std::sscanf(text.c_str(), "%2dx%2d%c", &grid.columns, &grid.rows, &end) != 2 ||
      std::min(grid.columns, grid.rows) < 1 || std::max(grid.columns, grid.rows) > 64) {
    return std::nullopt;
  }
  return grid;
}

}  // namespace

void BindDeviceOption(CLI::App& command, std::string& selector) {
  command
      .add_option("--device", selector,
                  "Compute device: auto, cpu, its index or a part of its name")
      ->capture_default_str();
}

void BindDetectorOptions(CLI::App& command, DetectorOptions& options) {
  command
      .add_option("--model", options.model,
                  "Line detector: a network's preset, the path of its .safetensors, or lsd")
      ->capture_default_str();
  BindDeviceOption(command, options.device);
  command
      .add_option("--score-threshold", options.score_threshold,
                  "Drop segments with a lower score (default: as the model says)")
      ->check(FiniteRange(0.0, 1.0));
  command
      .add_option("--top-k", options.max_lines,
                  "At most so many segments, the best (default: as the model says; of each tile)")
      ->check(CLI::Range(1, 4096));
  command
      .add_option("--min-length", options.min_length_px,
                  "Drop segments shorter than so many pixels")
      ->check(FiniteRange(0.0, 1e5))
      ->capture_default_str();
  command
      .add_option("--structural-nms", options.structural_nms,
                  "Drop segments whose ends are near a better one's: squared distances in an image "
                  "of 128 x 128, 2 is usual, 0 is off")
      ->check(FiniteRange(0.0, 1e5))
      ->capture_default_str();
  command
      .add_option("--tiles", options.tiles,
                  "For images much larger than the network's input: none, auto, or COLUMNSxROWS of "
                  "overlapping tiles")
      ->check([](const std::string& text) {
        return ParseTiles(text) ? std::string()
                                : "'" + text + "' is not none, auto or 1x1 .. 64x64";
      })
      ->capture_default_str();
}

Outcome OpenDevice(const std::string& selector, std::shared_ptr<gpu::Device>* out_device) {
  gpu::DeviceOptions options;
  options.selector = selector;
  Result<std::shared_ptr<gpu::Device>> device = gpu::Device::Create(options);
  if (!device) {
    const ErrorCode code = device.error().code;
    return Failure{code == ErrorCode::kInvalidArgument ? kExitUsage : kExitNoDevice,
                   "--device " + selector + ": " + device.error().message};
  }
  *out_device = *std::move(device);
  const gpu::DeviceInfo& info = (*out_device)->Info();
  if (info.IsSoftware()) PrintRemark("device: " + gpu::Describe(info));
  return std::nullopt;
}

Outcome CreateDetector(const DetectorOptions& options,
                       std::unique_ptr<LineDetector>* out_detector) {
  VlseDetectorOptions vlse;
  vlse.score_threshold = options.score_threshold;
  vlse.max_lines = options.max_lines;
  if (options.model != "lsd") {
    if (Outcome failed = OpenDevice(options.device, &vlse.device)) return failed;
  }
  Result<std::unique_ptr<LineDetector>> detector =
      CreateLineDetector(options.model, vlse, ModelFolders());
  if (!detector) return FailureFrom(detector.error());
  DetectionOptions detection;
  detection.selection.min_length_px = options.min_length_px;
  detection.selection.structural_nms = options.structural_nms;
  detection.tiles = *ParseTiles(options.tiles);
  if (options.model == "lsd") {  // which has no thresholds of its own
    detection.selection.min_score = options.score_threshold.value_or(0.0f);
    detection.selection.max_count = static_cast<size_t>(options.max_lines.value_or(0));
  }
  detector = ConfigureDetector(*std::move(detector), detection);
  if (!detector) return FailureFrom(detector.error());
  *out_detector = *std::move(detector);
  return std::nullopt;
}

Result<std::vector<Segment2>> DetectRefined(const ImageView& image, const Rectifier& rectifier,
                                            LineDetector* detector, SegmentRefiner* refiner) {
  const Result<std::vector<Segment2>> raw = detector->Detect(image);
  if (!raw) return raw.error();
  return refiner->Refine(image, *raw, &rectifier);
}

}  // namespace plumb::tools
