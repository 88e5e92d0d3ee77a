// Candidate lines as parallel arrays, projected eight at a time.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/matching/candidate_line.h"

namespace plumb {

/// Lines in the frame of a camera near which they are projected, which keeps single precision exact
/// enough anywhere in the world. Padded to a multiple of kLanes with lines that are never visible.
struct CandidateTable {
  static constexpr size_t kLanes = 8;

  /// No allocation once the capacity suffices.
  void Assign(std::span<const CandidateLine> lines, const Rigid3& reference_from_world);

  size_t padded_size() const { return weight.size(); }

  Rigid3 reference_from_world;
  size_t count = 0;                                                   // without the padding
  std::vector<float> start_x, start_y, start_z, end_x, end_y, end_z;  // [m]
  std::vector<float> weight;
};

/// As ProjectCandidates(), but one row a candidate, padding included: rows that are not visible
/// have the length 0. Positions are exact to 0.001 px, angles to 0.004 rad. Also fills the rows'
/// ends in the camera, which are not clipped.
void ProjectTable(const Camera& camera, const Rigid3& cam_from_world, const CandidateTable& table,
                  double min_length_px, ProjectedLines* out);

}  // namespace plumb
