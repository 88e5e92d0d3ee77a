// Frames for a benchmark of the refinement alone: segments, points and priors without images.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "plumb/map/line_map.h"
#include "plumb/runtime/pose_refiner.h"
#include "tools/plumbline/exit_code.h"
#include "tools/plumbline/frame_run.h"

namespace plumb::tools {

struct RefineQuery {
  std::vector<Segment2> segments;
  std::vector<PointMatch> points;
  PosePrior prior;
  std::vector<PosePrior> more_priors;
  std::optional<Rigid3> true_cam_from_world;
};

struct RefineQueries {
  Camera camera;
  std::vector<RefineQuery> queries;
};

struct CityQueryOptions {
  uint32_t num_lines = 100'000, num_segments = 200, num_points = 500;
  size_t num_frames = 300;
  double prior_cm = 10.0, prior_deg = 2.0;  // every prior is off by exactly so much
  uint64_t seed = 1;
};

/// A generated map and frames in it (tools/synth/line_city).
Outcome MakeCityQueries(const CityQueryOptions& options, LineMap* out_map,
                        RefineQueries* out_queries);

/// The frames of a recorded sequence.
/// @param segments_path  What `plumbline detect --refined --json` printed for images of the same
///                       names; empty: the run's detector finds them.
Outcome ReadQueries(FrameRun* run, const std::string& segments_path, size_t limit,
                    RefineQueries* out_queries);

}  // namespace plumb::tools
