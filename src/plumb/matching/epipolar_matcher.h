// The paper's matching: epipolar overlap with the key frames' segments, then the reprojection gate.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// A key frame's segments whose 3D lines are known.
struct DatabaseView {
  Camera camera;
  Rigid3 cam_from_world;
  std::span<const Segment2> segments;
  std::span<const uint32_t> lines;  // 3D line of each segment, same length
};

/// Segment `segment` of the query may be an image of 3D line `line`.
struct MatchCandidate {
  uint32_t segment = 0;
  uint32_t line = 0;

  friend auto operator<=>(const MatchCandidate&, const MatchCandidate&) = default;
};

/// One-to-many candidates of one key frame: pairs whose mutual epipolar overlap exceeds
/// `min_overlap` under the prior `cam_from_world`, appended to `out`; duplicates are left in. A
/// view with the prior's own centre has no epipolar geometry and adds nothing. Source: PtLine
/// Module III, eq. 2 to 4; 0.25 is Line3D++'s threshold.
void AppendEpipolarCandidates(const Camera& camera, const Rigid3& cam_from_world,
                              std::span<const Segment2> segments, const DatabaseView& view,
                              double min_overlap, std::vector<MatchCandidate>* out);

/// Gates of the reprojection cost.
struct ReprojectionGates {
  double max_midpoint_px = 10.0;
  double max_sine = 0.4;
};

/// An accepted one-to-one match.
struct LineAssignment {
  uint32_t segment = 0;
  uint32_t line = 0;
  double projected_length_px = 0.0;  // |l'|, the scale s of the angle residual (PtLine eq. 7)
};

/// Makes candidates one-to-one on both sides: smallest reprojection cost |midpoint distance| + s
/// |sin| first (PtLine eq. 5 to 7), ties by segment, then line. Lines with an end point nearer
/// than kNearPlane, segments without length and candidates outside the gates are left out.
/// @param lines       3D lines that MatchCandidate::line indexes.
/// @param candidates  Sorted, without duplicates.
void AssignOneToOne(const Camera& camera, const Rigid3& cam_from_world,
                    std::span<const Segment2> segments, std::span<const Segment3> lines,
                    std::span<const MatchCandidate> candidates, const ReprojectionGates& gates,
                    std::vector<LineAssignment>* out);

}  // namespace plumb
