#include "plumb/matching/epipolar_matcher.h"

#include <algorithm>
#include <cmath>

#include "plumb/geometry/epipolar.h"
#include "plumb/geometry/line_projection.h"

namespace plumb {

void AppendEpipolarCandidates(const Camera& camera, const Rigid3& cam_from_world,
                              std::span<const Segment2> segments, const DatabaseView& view,
                              double min_overlap, std::vector<MatchCandidate>* out) {
  const auto geometry =
      EpipolarGeometry::Create(camera, cam_from_world, view.camera, view.cam_from_world);
  if (!geometry) return;
  std::vector<bool> usable(view.segments.size());
  for (size_t k = 0; k < view.segments.size(); ++k) {
    usable[k] = !geometry->EpipoleTouches(view.segments[k]);
  }
  for (uint32_t i = 0; i < segments.size(); ++i) {
    const auto band = geometry->BandOf(segments[i]);
    if (!band) continue;
    for (size_t k = 0; k < view.segments.size(); ++k) {
      if (!usable[k]) continue;
      const auto overlap = BandOverlap(*band, view.segments[k]);
      if (overlap && *overlap > min_overlap) out->push_back({i, view.lines[k]});
    }
  }
}

void AssignOneToOne(const Camera& camera, const Rigid3& cam_from_world,
                    std::span<const Segment2> segments, std::span<const Segment3> lines,
                    std::span<const MatchCandidate> candidates, const ReprojectionGates& gates,
                    std::vector<LineAssignment>* out) {
  out->clear();
  struct Scored {
    double cost;
    LineAssignment assignment;
  };
  std::vector<Scored> scored;
  for (const MatchCandidate& candidate : candidates) {
    const Eigen::Vector3d a = cam_from_world * lines[candidate.line].start;
    const Eigen::Vector3d b = cam_from_world * lines[candidate.line].end;
    if (!(a.z() > kNearPlane) || !(b.z() > kNearPlane)) continue;
    const Segment2 image{camera.Project(a), camera.Project(b)};
    const Segment2& segment = segments[candidate.segment];
    const double length = image.Length();
    const double detected = segment.Length();
    if (!(length > 1e-6) || !(detected > 1e-6)) continue;
    const Eigen::Vector2d u = image.Delta() / length;
    const Eigen::Vector2d v = segment.Delta() / detected;
    const double sine = std::abs(u.x() * v.y() - u.y() * v.x());
    const double distance = (image.Midpoint() - segment.Midpoint()).norm();
    if (!(distance < gates.max_midpoint_px) || !(sine < gates.max_sine)) continue;
    scored.push_back({distance + length * sine, {candidate.segment, candidate.line, length}});
  }
  std::sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) {
    if (a.cost != b.cost) return a.cost < b.cost;
    if (a.assignment.segment != b.assignment.segment) {
      return a.assignment.segment < b.assignment.segment;
    }
    return a.assignment.line < b.assignment.line;
  });
  std::vector<bool> segment_taken(segments.size()), line_taken(lines.size());
  for (const Scored& entry : scored) {
    const LineAssignment& assignment = entry.assignment;
    if (segment_taken[assignment.segment] || line_taken[assignment.line]) continue;
    segment_taken[assignment.segment] = line_taken[assignment.line] = true;
    out->push_back(assignment);
  }
}

}  // namespace plumb
