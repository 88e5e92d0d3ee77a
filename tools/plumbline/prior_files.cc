// Files with the coarse poses of a recorded sequence.
#include "tools/plumbline/prior_files.h"

#include <algorithm>
#include <cstdio>
#include <numbers>
#include <optional>
#include <utility>

#include "plumb/runtime/refine_input_check.h"
#include "tools/datasets/text_file.h"
#include "tools/datasets/timestamp.h"
#include "tools/datasets/trajectory.h"

namespace plumb::tools {
namespace {

// What the refinement takes, in cm and deg.
constexpr double kMinPoseSize = 1e-7;
constexpr double kMaxPoseSizeCm = 100.0 * kMaxPositionSigmaM, kMaxPoseSizeDeg = 183.0;
static_assert(kMaxPoseSizeDeg * std::numbers::pi / 180.0 <= kMaxRotationSigmaRad);

/// One prior a frame; nullopt where `path` has none. A file that names no frame is refused.
/// @param option  That gave the size, for messages.
Outcome ReadSomePriors(const std::string& path, const std::string& option, const std::string& size,
                       const std::vector<SequenceFrame>& frames,
                       std::vector<std::optional<PosePrior>>* out_priors) {
  double cm = 0.0, deg = 0.0;
  if (Outcome failed = ParsePoseSize(option, size, &cm, &deg)) return failed;
  PosePrior prior;
  // The smallest size must not be rounded below what the refinement takes.
  prior.position_sigma_m = std::max(cm / 100.0, kMinSigma);
  prior.rotation_sigma_rad = deg * std::numbers::pi / 180.0;
  const Result<Trajectory> poses = ReadTumTrajectory(path);
  if (!poses) return FailureFrom(poses.error());
  size_t num_found = 0;
  for (const SequenceFrame& frame : frames) {
    std::optional<PosePrior>& out = out_priors->emplace_back();
    const StampedPose* pose = NearestPose(*poses, frame.timestamp_ns, kSameFrameNs);
    if (pose == nullptr) continue;
    prior.cam_from_world = pose->cam_from_world;
    out = prior;
    ++num_found;
  }
  if (num_found == 0) {
    return Failure{kExitBadData,
                   path + ": names none of the " + std::to_string(frames.size()) + " query frames"};
  }
  return std::nullopt;
}

}  // namespace

Outcome ParsePoseSize(const std::string& option, const std::string& text, double* out_cm,
                      double* out_deg) {
  const auto wrong = [&](const std::string& what) {
    return Failure{kExitUsage, option + " " + Shortened(text) + ": " + what};
  };
  const std::vector<DataLine> lines = DataLines(text);
  if (lines.size() != 1 || lines[0].fields.size() != 2) {
    return wrong("want two positive numbers, CM,DEG");
  }
  const struct {
    const char* unit;
    double max;
    double* out;
  } parts[] = {{"cm", kMaxPoseSizeCm, out_cm}, {"deg", kMaxPoseSizeDeg, out_deg}};
  for (size_t i = 0; i < 2; ++i) {
    const Result<double> number = ParseNumber(lines[0].fields[i]);
    if (!number || !(*number > 0.0)) return wrong("want two positive numbers, CM,DEG");
    if (!(*number >= kMinPoseSize && *number <= parts[i].max)) {
      char range[80];
      std::snprintf(range, sizeof(range), "%.6g %s is outside %.6g to %.6g", *number, parts[i].unit,
                    kMinPoseSize, parts[i].max);
      return wrong(range);
    }
    *parts[i].out = *number;
  }
  return std::nullopt;
}

Outcome ReadPriors(const std::string& path, const std::string& size,
                   const std::vector<SequenceFrame>& frames, std::vector<PosePrior>* out_priors) {
  std::vector<std::optional<PosePrior>> found;
  if (Outcome failed = ReadSomePriors(path, "--prior-size", size, frames, &found)) return failed;
  size_t num_missing = 0;
  int64_t first_missing_ns = 0;
  for (size_t i = 0; i < frames.size(); ++i) {
    if (found[i]) {
      out_priors->push_back(*found[i]);
    } else if (num_missing++ == 0) {
      first_missing_ns = frames[i].timestamp_ns;
    }
  }
  if (num_missing > 0) {
    return Failure{kExitBadData, path + ": no pose for " + std::to_string(num_missing) +
                                     " of the " + std::to_string(frames.size()) +
                                     " frames, the first is " + FormatTimestamp(first_missing_ns)};
  }
  return std::nullopt;
}

Outcome ReadMorePriors(const std::vector<std::string>& files, const std::string& default_size,
                       const std::vector<SequenceFrame>& frames,
                       std::vector<std::vector<PosePrior>>* out_priors) {
  if (files.size() > kMaxMorePriors) {
    return Failure{kExitUsage, "--more-priors: " + std::to_string(files.size()) +
                                   " files, at most " + std::to_string(kMaxMorePriors)};
  }
  out_priors->resize(frames.size());
  for (const std::string& file : files) {
    const size_t colon = file.rfind(':');
    const std::string path = file.substr(0, colon);
    const std::string size = colon == std::string::npos ? default_size : file.substr(colon + 1);
    std::vector<std::optional<PosePrior>> found;
    if (Outcome failed = ReadSomePriors(path, "--more-priors", size, frames, &found)) {
      return failed;
    }
    for (size_t i = 0; i < frames.size(); ++i) {
      if (found[i]) (*out_priors)[i].push_back(*found[i]);
    }
  }
  return std::nullopt;
}

}  // namespace plumb::tools
