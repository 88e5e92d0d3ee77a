// Lifts 2D segments to 3D with the depth beside them, never with the torn depth on the edge itself.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/depth_view.h"

namespace plumb {

struct LiftOptions {
  double min_depth_m = 0.2;
  double max_depth_m = 8.0;
  double min_length_px = 12.0;  // of the part that could be lifted
  double max_length_m = 6.0;
  double inverse_depth_tolerance = 0.008;  // [1/m] a sample within it lies on a side's plane
  double same_surface_tolerance = 0.015;   // [1/m] two sides within it at both ends are one surface
};

/// The part of a detected segment that depth supports.
struct LiftedPart {
  uint32_t source = 0;      // index into the segments that were lifted
  Segment2 segment_px;      // along the detected segment, same direction and score
  Segment3 segment_in_cam;  // on the rays of segment_px's end points
};

/// Each side of a segment is fitted with a plane (affine in inverse depth) by RANSAC. Two sides
/// that meet: a crease or a drawn line, their mean. Two that differ: the nearer surface owns the
/// edge. One side only: taken unless the other is nearer. Then the longest supported run is kept.
/// Deterministic: the draws are fixed.
///
/// @param depth      Valid, of the size of the camera or, with a lens, of the taken image.
/// @param segments   [px]; those that are too short or not finite are dropped.
/// @param rectifier  Null or identity: depth and segments share `camera`. Otherwise `camera` and
/// the segments are
///                   those of its ideal image, and depth is looked up in the taken image, beside
///                   the curves that the segments are there.
/// @return lifted parts in the order of `segments`; at most one for each.
/// Source: docs/method/association.md.
std::vector<LiftedPart> LiftSegments(const Camera& camera, const DepthView& depth,
                                     std::span<const Segment2> segments,
                                     const LiftOptions& options = {},
                                     const Rectifier* rectifier = nullptr);

}  // namespace plumb
