// The paper's PnP-RANSAC filter: observations that a key frame's other observations contradict.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/segment.h"

namespace plumb {

struct PnpFilterOptions {
  bool enabled = true;
  double threshold_px = 2.0;  // reprojection error of an inlier
  int iterations = 500;
  double confidence = 0.999;
  uint32_t min_inliers = 12;  // end points; fewer: nothing is known, nothing is filtered
};

/// A segment of one key frame and the place, according to the *other* key frames, of its two ends.
struct PnpObservation {
  Segment2 segment_px;
  Segment3 predicted_in_world;
};

/// Solves the key frame's pose from all end points with PnP-RANSAC.
/// @return for each observation whether both of its end points are inliers (PtLine, Module II);
///         all true when there is no consensus of min_inliers.
/// The key frame's own lifted end points would be inliers by construction, whatever their depth,
/// hence the prediction from other views. Deterministic.
std::vector<bool> PnpInliers(const Camera& camera, std::span<const PnpObservation> observations,
                             const PnpFilterOptions& options);

}  // namespace plumb
