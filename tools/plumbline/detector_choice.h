// From the options that every command with a detector has to a line detector.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "plumb/features/line_detector.h"
#include "plumb/features/segment_refiner.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/gpu/device.h"
#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// Score threshold of commands that report scores: also the candidates that a pose is not built on,
/// which are for the reader to judge.
inline constexpr float kCandidateScore = 0.01f;

/// Options that every command with a detector shares.
struct DetectorOptions {
  std::string model = "nano";
  std::string device = "auto";
  std::optional<float> score_threshold;  // absent: the model's
  std::optional<int> max_lines;          // absent: the model's
  double min_length_px = 0.0;
  double structural_nms = 0.0;
  std::string tiles = "none";  // none, auto or CxR
};

/// Declares --model, --device, --score-threshold, --top-k, --min-length, --structural-nms, --tiles.
void BindDetectorOptions(CLI::App& command, DetectorOptions& options);
void BindDeviceOption(CLI::App& command, std::string& selector);

/// Opens a compute device; says so on stderr when it is a software device.
/// @return kExitNoDevice if there is none that `selector` names.
Outcome OpenDevice(const std::string& selector, std::shared_ptr<gpu::Device>* out_device);

/// Creates the detector that `options` name. Presets are looked up as
/// assets/models/NAME.safetensors and share/plumbline/models/NAME.safetensors in the folders above
/// the program.
Outcome CreateDetector(const DetectorOptions& options, std::unique_ptr<LineDetector>* out_detector);

/// An image's segments, detected and moved on to its edges, as maps and poses use them.
/// @param rectifier  Of the image's lens.
Result<std::vector<Segment2>> DetectRefined(const ImageView& image, const Rectifier& rectifier,
                                            LineDetector* detector, SegmentRefiner* refiner);

}  // namespace plumb::tools
