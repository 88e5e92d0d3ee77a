// Lifts the segments of posed key frames to 3D without depth, by agreement of several views.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/view_neighbours.h"

namespace plumb {

struct TriangulationOptions {
  ViewNeighbourOptions neighbours;
  double min_length_px = 12.0;
  double min_depth_m = 0.2;
  double min_overlap = 0.5;  // of the two segments in one image, over the shorter one
  /// Of an end point across its segment, errors of poses included; a first guess, see below.
  double pixel_sigma_px = 0.7;
  double max_deviation = 2.5;  // of views that agree, in standard deviations
  uint32_t min_views = 3;      // that must agree, the segment's own included; at least 3
  /// Largest standard deviation of a depth over the depth: of two views (weaker ones are not looked
  /// at) and of all that agree.
  double max_pair_sigma = 0.3, max_sigma = 0.1;
};

struct SegmentView {
  Camera camera;
  Rigid3 cam_from_world;
  std::span<const Segment2> segments;  // [px]
};

/// A segment with the depths that other views give its two ends.
struct TriangulatedSegment {
  uint32_t source = 0;              // index into the view's segments
  std::array<double, 2> depth_m{};  // of start and end, along the optical axis
  std::array<double, 2> sigma_m{};  // standard deviations, errors of poses included
  Segment3 segment_in_world;        // on the rays of the segment's ends
};

/// A segment of one view and a segment of another give a hypothesis: the depths at which the rays
/// of the first one's ends meet the plane of the second. Hypotheses whose depth is too uncertain
/// (short baseline, line in one plane with both centres) are left out. Of a segment's hypotheses
/// the one wins that most other views agree with, unless another depth is nearly as good; they are
/// averaged. Then the segments that agree must themselves have been lifted to the same line. Lastly
/// the noise is measured from how well the views agree, and all is done again with it.
/// @return for every view what could be lifted, in the order of its segments. Deterministic.
std::vector<std::vector<TriangulatedSegment>> TriangulateSegments(
    std::span<const SegmentView> views, const TriangulationOptions& options = {},
    const std::function<void(double done)>& progress = {});

}  // namespace plumb
