// Calibrates a map's covariance factor on key frames that were left out of it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/line_map.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {

/// A posed frame that the map was not built from.
struct HeldOutFrame {
  Camera camera;
  Rigid3 cam_from_world;
  std::vector<Segment2> segments;  // [px], after SegmentRefiner
};

struct CovarianceCalibration {
  double factor = 1.0;     // LineMap::covariance_factor for this map and its like
  size_t num_refined = 0;  // frames that the factor is the median of
};

/// Fewer refined frames say nothing: the map's own factor is returned.
inline constexpr size_t kMinCalibrationFrames = 5;

/// Refines every held-out frame from a random prior of 10 cm and 2 deg (norms, one standard
/// deviation) and compares the errors with the reported covariances. Errors of map and key-frame
/// poses are common to all lines of a frame: its residuals do not show them, left-out frames do.
/// The factor is the median of e^T C^-1 e over that of a chi-square variable with 6 degrees of
/// freedom, so that a few wrong poses do not count. The factor also enters the observability check:
/// a map with a large one has more DEGENERATE frames. Leave out every fifth key frame, calibrate,
/// and give the factor to the map of all key frames. Deterministic: the priors follow options.seed.
///
/// @param map  Built without the frames; its own factor is taken into account.
/// @return kInvalidArgument as PoseRefiner::Create() and Refine() do.
/// Source: docs/method/association.md.
Result<CovarianceCalibration> CalibrateCovariance(const LineMap& map,
                                                  std::span<const HeldOutFrame> frames,
                                                  const PoseRefinerOptions& options);

}  // namespace plumb
