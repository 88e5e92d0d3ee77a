// A segment found in a distorted image as the straight segment of the ideal image.
#pragma once

#include <optional>
#include <vector>

#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// A detected segment is roughly straight, its edge is a curve, and detectors differ in which of
/// the curve's points they meet. Both answers are segments [px of the ideal image] with the
/// detected one's direction and score.
struct StraightenedSegment {
  /// Nearest to samples along the detected segment (total least squares), cut to the outermost of
  /// them: right for detectors that fit all of an edge.
  Segment2 nearest;
  /// Between the outermost samples: right for detectors that look for end points.
  Segment2 through_ends;
};

/// Undistorts samples along a segment. What lies outside of what the lens images is left out. The
/// edge itself is followed afterwards, along the curve (segment_ridge.h).
/// @return nothing when less than two samples could be undistorted.
std::optional<StraightenedSegment> StraightenSegment(const Rectifier& rectifier,
                                                     const Segment2& segment_px);

/// The nearest ones of all in their order, without those of which nothing is left; unchanged
/// without a lens.
std::vector<Segment2> StraightenSegments(const Rectifier& rectifier,
                                         std::vector<Segment2> segments_px);

}  // namespace plumb
