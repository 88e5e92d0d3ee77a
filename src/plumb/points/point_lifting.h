// Points of a posed RGB-D key frame, for the map.
#pragma once

#include <vector>

#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/depth_view.h"
#include "plumb/map/line_map.h"
#include "plumb/points/point_features.h"

namespace plumb {

struct PointLiftOptions {
  double min_depth_m = 0.2;
  double max_depth_m = 6.0;
  /// Largest difference between the depths 2 px around the point over its depth: torn depth at
  /// edges is left out.
  double max_relative_spread = 0.03;
};

/// Lifts the points with the depth of their nearest pixel and leaves out those that have none.
/// @param points  of the taken image; what is lifted has its place in the ideal one.
/// @param depth   Valid, of the taken image's size.
std::vector<MapPoint> LiftPoints(const ImagePoints& points, const Rectifier& rectifier,
                                 const Rigid3& cam_from_world, const DepthView& depth,
                                 const PointLiftOptions& options = {});

}  // namespace plumb
