#include "plumb/runtime/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "plumb/refine/camera_adjustment.h"

namespace plumb {
namespace {

constexpr uint32_t kMinObserving = 3;  // key frames, of a line that says something
constexpr size_t kMaxLines = 800;      // the first: those of the longest tracks
constexpr size_t kMinSightings = 500;  // a half
constexpr double kMinGain = 10.0;      // [nat]
constexpr double kMinShiftPx = 0.1;
constexpr int kShiftSteps = 16;  // a side of the image

struct Sightings {
  std::vector<CameraSighting> all, first_half, second_half;
};

Sightings Collect(const LineMap& map, const Rectifier& rectifier) {
  Sightings out;
  const auto num_key_frames = static_cast<uint32_t>(map.key_frames.size());
  const size_t num_lines = std::min(map.lines.size(), kMaxLines);
  for (uint32_t k = 0; k < num_key_frames; ++k) {
    for (const LiftedSegment& segment : map.key_frames[k].segments) {
      if (!segment.line || *segment.line >= num_lines ||
          map.lines[*segment.line].num_observing < kMinObserving) {
        continue;
      }
      const auto start = rectifier.ToImage(segment.segment_px.start);
      const auto end = rectifier.ToImage(segment.segment_px.end);
      if (!start || !end) continue;
      out.all.push_back({k, *segment.line, {start->px, end->px}});
      (2 * k < num_key_frames ? out.first_half : out.second_half).push_back(out.all.back());
    }
  }
  return out;
}

class HeldOut {
 public:
  HeldOut(const LineMap& map, const ImageCamera& given) : given_(given) {
    for (const KeyFrame& frame : map.key_frames) poses_.push_back(frame.cam_from_world);
    const size_t count = std::min(map.lines.size(), kMaxLines);
    for (size_t i = 0; i < count; ++i) lines_.push_back(map.lines[i].segment_in_world);
  }

  std::optional<AdjustedCamera> Fit(const std::vector<CameraSighting>& sightings) const {
    return AdjustCamera(given_, poses_, lines_, sightings);
  }

  // True if the camera of `fitted` explains `others` better than the given one.
  bool Explains(const std::vector<CameraSighting>& fitted,
                const std::vector<CameraSighting>& others) const {
    const std::optional<AdjustedCamera> camera = Fit(fitted);
    if (!camera) return false;
    CameraAdjustmentOptions fixed;
    fixed.camera_is_fixed = true;
    fixed.unit_focal_px = Eigen::Vector2d(given_.pinhole.fx, given_.pinhole.fy);
    const auto before = AdjustCamera(given_, poses_, lines_, others, fixed);
    const auto after = AdjustCamera(camera->camera, poses_, lines_, others, fixed);
    // What a camera cannot have imaged must not count in its favour.
    return before && after && after->num_sightings == before->num_sightings &&
           after->cost < before->cost - kMinGain;
  }

 private:
  const ImageCamera given_;
  std::vector<Rigid3> poses_;
  std::vector<Segment3> lines_;
};

// Calls visit(pixel, the same ray's pixel by the other camera or nullopt) over the image.
template <typename Visit>
void ForEachPixelPair(const CameraCorrection& correction, const Visit& visit) {
  const auto from = LensMapping::Create(correction.given.lens);
  const auto to = LensMapping::Create(correction.corrected.lens);
  if (!from || !to) return;
  const Camera &given = correction.given.pinhole, &corrected = correction.corrected.pinhole;
  for (int i = 0; i <= kShiftSteps; ++i) {
    for (int j = 0; j <= kShiftSteps; ++j) {
      const Eigen::Vector2d px(i * (given.width_px - 1.0) / kShiftSteps,
                               j * (given.height_px - 1.0) / kShiftSteps);
      const auto ray = from->Undistort(given.Normalize(px));
      if (!ray) continue;
      const auto imaged = to->Distort(*ray);
      visit(px, imaged ? std::optional<Eigen::Vector2d>(
                             {corrected.fx * imaged->point.x() + corrected.cx,
                              corrected.fy * imaged->point.y() + corrected.cy})
                       : std::nullopt);
    }
  }
}

bool KeepsTheWholeImage(const CameraCorrection& correction) {
  bool keeps = true;
  ForEachPixelPair(correction, [&keeps](const Eigen::Vector2d&, const auto& imaged) {
    keeps = keeps && imaged.has_value();
  });
  return keeps;
}

}  // namespace

std::optional<CameraCorrection> CalibrateCamera(const LineMap& map, const Rectifier& rectifier) {
  const Sightings sightings = Collect(map, rectifier);
  if (std::min(sightings.first_half.size(), sightings.second_half.size()) < kMinSightings) {
    return std::nullopt;
  }
  const ImageCamera& given = rectifier.image_camera();
  const HeldOut held_out(map, given);
  if (!held_out.Explains(sightings.first_half, sightings.second_half) ||
      !held_out.Explains(sightings.second_half, sightings.first_half)) {
    return std::nullopt;
  }
  const std::optional<AdjustedCamera> fitted = held_out.Fit(sightings.all);
  if (!fitted || !Rectifier::Create(fitted->camera)) return std::nullopt;
  const CameraCorrection correction{given, fitted->camera};
  if (LargestShiftPx(correction) < kMinShiftPx || !KeepsTheWholeImage(correction)) {
    return std::nullopt;
  }
  return correction;
}

double LargestShiftPx(const CameraCorrection& correction) {
  double largest = 0.0;
  ForEachPixelPair(correction, [&largest](const Eigen::Vector2d& px, const auto& imaged) {
    if (imaged) largest = std::max(largest, (*imaged - px).norm());
  });
  return largest;
}

}  // namespace plumb
