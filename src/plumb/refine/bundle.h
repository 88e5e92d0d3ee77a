// Joint adjustment of the poses of several views and the 3D lines that they see.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// A view whose pose is known with an uncertainty.
struct BundleView {
  Rigid3 prior;                                        // cam_from_world
  Rigid3 start;                                        // where the adjustment begins, often `prior`
  Eigen::Vector2d focal_px = Eigen::Vector2d::Ones();  // (fx, fy), may be negative
};

/// One segment of a view that shows a line.
struct BundleSighting {
  uint32_t view = 0, line = 0;
  Segment2 segment_normalized;            // on the plane z = 1
  std::optional<Segment3> lifted_in_cam;  // where the view's own depth puts its ends
  double depth_sigma_m = 0.0;             // of those, > 0
};

struct BundleOptions {
  double position_sigma_m = 0.005, rotation_sigma_rad = 0.00175;  // of priors
  double pixel_sigma_px = 0.35;  // of a segment's ends across it, after SegmentRefiner
  double cauchy_scale = 2.0;     // in standard deviations
  int max_iterations = 30;
};

struct Bundle {
  std::vector<Rigid3> cam_from_world;  // of the views
  std::vector<Segment3> lines_in_world;
  double initial_cost = 0.0, final_cost = 0.0;
};

/// Minimises, over all poses and lines, the perpendicular distances of the segments to their
/// projected lines and the offsets of the lifted ends across them, robustly, and the distance of
/// every pose from its prior. The priors alone fix the gauge: the poses as a whole stay where the
/// priors' mean has them. Deterministic.
///
/// @param lines_in_world  Start values; a line without length or sightings stays as it is.
/// @return nullopt for input out of range (an index, a sigma, a number that is not finite) and when
///         no step could be made.
std::optional<Bundle> AdjustBundle(std::span<const BundleView> views,
                                   std::span<const Segment3> lines_in_world,
                                   std::span<const BundleSighting> sightings,
                                   const BundleOptions& options = {});

}  // namespace plumb
