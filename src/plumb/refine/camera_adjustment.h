// Adjusts the intrinsics of the camera that took several posed views, together with the 3D lines
// that they see.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// One segment of a view that shows a line.
struct CameraSighting {
  uint32_t view = 0, line = 0;
  Segment2 segment_px;  // its ends where the camera images them: with the lens
};

struct CameraAdjustmentOptions {
  double pixel_sigma_px = 0.35;  // of a segment's ends across it, after SegmentRefiner
  double cauchy_scale = 2.0;     // in standard deviations
  /// Prior standard deviations of what changes.
  double focal_sigma = 0.02;       // of the logarithm of both focal lengths
  double centre_sigma = 0.01;      // of the principal point, over the focal lengths
  double distortion_sigma = 0.05;  // of k1 and k2
  int max_rounds = 3;              // undistortion is linearised once a round
  int max_iterations = 8;          // of a round
  /// Focal lengths of the pixels that distances are measured in; absent: those of the start. Costs
  /// compare in the same pixels only.
  std::optional<Eigen::Vector2d> unit_focal_px = std::nullopt;
  /// Lines adjust to the camera as it is.
  bool camera_is_fixed = false;
};

struct AdjustedCamera {
  ImageCamera camera;
  /// Negative logarithm of the sightings' likelihood [nat], but for a constant; of an adjusted
  /// camera with its prior. Compare costs of as many sightings in the same pixels only.
  double cost = 0.0;
  size_t num_sightings = 0;  // that the camera can have imaged
};

/// Minimises the perpendicular distances of the segments to their projected lines, robustly, over
/// the lines and the camera: one change of scale of both focal lengths, the principal point and
/// the two first radial coefficients of its lens. A camera without a lens gets one (kRadTan) whose
/// coefficients begin at 0. Deterministic.
///
/// @param lines_in_world  Start values. One without length or sightings says nothing.
/// @return nullopt for input out of range (an index, a sigma, a pose or a number that is not
///         finite, a camera that is not one) and when no first step could be made.
/// Source: docs/adr/0017-views-correct-the-camera.md.
std::optional<AdjustedCamera> AdjustCamera(const ImageCamera& start,
                                           std::span<const Rigid3> cam_from_world,
                                           std::span<const Segment3> lines_in_world,
                                           std::span<const CameraSighting> sightings,
                                           const CameraAdjustmentOptions& options = {});

}  // namespace plumb
