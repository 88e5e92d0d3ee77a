// Depth images and views together: segments that both have lifted get one depth.
#pragma once

#include <span>
#include <vector>

#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/depth_correction.h"
#include "plumb/map/lift.h"
#include "plumb/map/line_map.h"
#include "plumb/map/triangulation.h"

namespace plumb {

/// What a key frame's depth image and the other key frames say of its segments.
struct FrameLifts {
  Rigid3 cam_from_world;
  std::span<const Segment2> segments;             // [px]
  std::span<const LiftedPart> by_sensor;          // both ascending by source,
  std::span<const TriangulatedSegment> by_views;  // an index into `segments`
};

/// The ends of all parts that both have lifted. Views whose own deviation is above 3 % of the depth
/// are left out.
std::vector<DepthSample> CompareDepths(std::span<const FrameLifts> frames);

/// The frame's segments in the world: parts with corrected depth, averaged by variance with the
/// depth by views where both agree within three standard deviations; then the segments that have no
/// part, as the views have lifted them.
/// @param out_num_averaged  Added to; may be null.
std::vector<LiftedSegment> FuseLifts(const FrameLifts& frame, const DepthFit& fit,
                                     const DepthNoise& noise = {},
                                     size_t* out_num_averaged = nullptr);

}  // namespace plumb
