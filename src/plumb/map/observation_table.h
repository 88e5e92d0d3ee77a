// All lifted segments of all key frames in one numbered table, as the line fit needs them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/map/depth_view.h"
#include "plumb/map/line_fit.h"
#include "plumb/map/line_map.h"

namespace plumb {

/// Immutable. Observation `frame_begin(k) + i` is segment i of key frame k.
class ObservationTable {
 public:
  ObservationTable(std::span<const KeyFrame> key_frames, const DepthNoise& noise);
  ObservationTable(const ObservationTable&) = delete;  // observations point at views_
  ObservationTable& operator=(const ObservationTable&) = delete;

  uint32_t num_frames() const { return static_cast<uint32_t>(views_.size()); }
  uint32_t size() const { return static_cast<uint32_t>(observations_.size()); }
  const Camera& camera(uint32_t frame) const { return cameras_[frame]; }
  const Rigid3& cam_from_world(uint32_t frame) const { return poses_[frame]; }
  uint32_t frame_begin(uint32_t frame) const { return frame_begin_[frame]; }
  uint32_t frame_of(uint32_t observation) const { return frames_[observation]; }
  const Segment2& segment_px(uint32_t observation) const { return segments_px_[observation]; }
  const LineObservation& operator[](uint32_t observation) const {
    return observations_[observation];
  }

  std::span<const Segment2> SegmentsOf(uint32_t frame) const {
    return std::span(segments_px_)
        .subspan(frame_begin_[frame], frame_begin_[frame + 1] - frame_begin_[frame]);
  }
  /// Depth of the farthest lifted end point of the frame [m], 0 without any.
  double max_depth_m(uint32_t frame) const { return max_depth_m_[frame]; }

 private:
  std::vector<Camera> cameras_;
  std::vector<Rigid3> poses_;
  std::vector<LineView> views_;
  std::vector<LineObservation> observations_;
  std::vector<Segment2> segments_px_;
  std::vector<uint32_t> frames_;
  std::vector<uint32_t> frame_begin_{0};
  std::vector<double> max_depth_m_;
};

}  // namespace plumb
