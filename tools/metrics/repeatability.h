// How well a detector finds the same segments from another viewpoint, with depth and true poses.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/depth_view.h"

namespace plumb::tools {

/// One view of a static scene, borrowed.
struct RepeatabilityView {
  Rigid3 cam_from_world;
  DepthView depth;
  std::span<const Segment2> segments;  // [px of the ideal image]
};

/// What pairs of views add up to.
struct RepeatabilityTally {
  size_t num_pairs = 0;
  size_t num_expected = 0;        // segments of the first view that the second one should show
  size_t num_found = 0;           // of these, found again
  std::vector<double> errors_px;  // perpendicular distances to the nearest segments within 5 px

  double FoundShare() const {
    return num_expected > 0 ? static_cast<double>(num_found) / static_cast<double>(num_expected)
                            : 0.0;
  }
};

/// Lifts the segments of `first` with its depth and projects them into `second`, where each one
/// longer than 20 px that is not occluded is expected. It is found again if a segment there is
/// nearly parallel (sine < 0.087), lies beside more than half of it, and is within 2 px at both
/// ends of what they share. The error is the mean of the distances at those two ends, of the
/// nearest such segment within 5 px.
/// @param rectifier  of the camera and lens of both views
/// Source: docs/method/association.md.
void AddPair(const Rectifier& rectifier, const RepeatabilityView& first,
             const RepeatabilityView& second, RepeatabilityTally* tally);

}  // namespace plumb::tools
