// What every map must satisfy before it is written, and after it was read.
#pragma once

#include "plumb/base/result.h"
#include "plumb/map/line_map.h"

namespace plumb {

/// Checks that all numbers are finite, coordinates within 1e7 (m, px), and that all references
/// point at something:
/// - fused lines, lifted segments and their images have a length; covariances have no negative
///   variance; 1 <= num_observing <= num_expected
/// - sightings: key frames of one line strictly ascending, unit directions, distances > 0
/// - key frames: unit quaternions, valid cameras; scores in [0, 1]; LiftedSegment::line exists
/// - covariance_factor > 0; covariance_growth and pose_change >= 0
/// - both cameras of camera_correction can be rectified, have one size, and mirror alike
/// - `detector` is at most 1024 bytes of UTF-8
/// @return kInvalidArgument naming the first offender.
Status CheckMap(const LineMap& map);

}  // namespace plumb
