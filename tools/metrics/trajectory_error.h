// How far refined poses are from the truth, and whether they are better than the priors.
#pragma once

#include <cstddef>
#include <span>

#include "plumb/geometry/rigid3.h"

namespace plumb::tools {

/// The three poses of one frame.
struct FrameEvaluation {
  Rigid3 true_cam_from_world;
  Rigid3 prior_cam_from_world;
  Rigid3 refined_cam_from_world;
};

struct ErrorSummary {
  double median_cm = 0.0, median_deg = 0.0;
  double p90_cm = 0.0, p90_deg = 0.0;
  double recall_2cm_2deg = 0.0, recall_5cm_5deg = 0.0;  // share of the frames below both, 0..1
};

struct TrajectoryEvaluation {
  size_t num_frames = 0;
  ErrorSummary prior, refined;
  double improved = 0.0;  // share of the frames nearer to the truth in position and in rotation
  double harmed = 0.0;    // share farther off than the prior by > 0.5 cm or > 0.1 deg
};

/// Distances of camera centres and angles between rotations. No alignment: the poses are claimed to
/// be in the map's frame, and an alignment would hide their error.
TrajectoryEvaluation EvaluateTrajectory(std::span<const FrameEvaluation> frames);

}  // namespace plumb::tools
