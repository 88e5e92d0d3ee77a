// Which segments of a key frame may belong to which projected lines?
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/segment.h"
#include "plumb/map/line_cloud.h"

namespace plumb {

/// When does a segment belong to a line? All of these must hold.
struct AssociationGate {
  double max_sine = 0.0;         // of the angle between segment and projected line
  double max_distance_px = 0.0;  // of both ends of the overlap from the projected line
  double min_overlap = 0.0;      // over the length of the shorter one
  double depth_margin_m = 0.0;   // lifted ends within 3 (depth sigma + margin) of the 3D line
};

struct AssociationCandidate {
  uint32_t line = 0;
  uint32_t segment = 0;      // index into the segments
  double distance_px = 0.0;  // the larger one at the two ends of the overlap
};

/// The segments of one image, sorted by angle, so that a line only meets those of its direction.
class SegmentsByAngle {
 public:
  explicit SegmentsByAngle(std::span<const Segment2> segments_px);

  /// Appends every segment that passes the gate in the image (depth is not looked at). Their order
  /// is fixed, but not by index.
  void AppendCandidates(const ProjectedLine& line, const AssociationGate& gate,
                        std::vector<AssociationCandidate>* out_candidates) const;

 private:
  struct Entry {
    double angle_rad;  // -pi/2 .. 3 pi/2: every segment twice, so that windows need not wrap
    uint32_t segment;
    Segment2 segment_px;
    Eigen::Vector2d direction;
    double length_px;
  };
  std::vector<Entry> entries_;
};

}  // namespace plumb
