#include "plumb/map/observation_table.h"

#include <algorithm>

namespace plumb {

ObservationTable::ObservationTable(std::span<const KeyFrame> key_frames, const DepthNoise& noise) {
  views_.reserve(key_frames.size());  // observations point into it
  for (uint32_t k = 0; k < key_frames.size(); ++k) {
    const KeyFrame& frame = key_frames[k];
    cameras_.push_back(frame.camera);
    poses_.push_back(frame.cam_from_world);
    views_.push_back({frame.cam_from_world.RotationMatrix(),
                      frame.cam_from_world.translation,
                      {frame.camera.fx, frame.camera.fy}});
    double max_depth_m = 0.0;
    for (const LiftedSegment& segment : frame.segments) {
      const double start_m = (frame.cam_from_world * segment.segment_in_world.start).z();
      const double end_m = (frame.cam_from_world * segment.segment_in_world.end).z();
      max_depth_m = std::max({max_depth_m, start_m, end_m});
      observations_.push_back({&views_[k], frame.camera.Normalize(segment.segment_px.start),
                               frame.camera.Normalize(segment.segment_px.end),
                               segment.segment_in_world, noise.SigmaAt(0.5 * (start_m + end_m))});
      segments_px_.push_back(segment.segment_px);
      frames_.push_back(k);
    }
    frame_begin_.push_back(size());
    max_depth_m_.push_back(max_depth_m);
  }
}

}  // namespace plumb
