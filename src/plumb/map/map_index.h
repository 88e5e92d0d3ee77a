// Spatial index over a map's lines and key frames: what can a camera at this pose see?
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/line_map.h"

namespace plumb {

/// Which lines count as visible (docs/method/association.md).
struct VisibilityOptions {
  double max_view_angle_rad = 0.698;  // 40 deg between the view and a sighting's view of the line
  double max_distance_ratio = 2.0;    // distance to the line over a sighting's distance, both ways
  double margin_px = 60.0;            // the image is enlarged by this on every side
  double min_length_px = 15.0;        // of the visible part
  uint32_t min_observing = 2;         // key frames that observed the line
  uint32_t nearest_key_frames = 0;    // > 0: seen by one of so many nearest key frames
};

/// A fused line that a camera sees.
struct VisibleLine {
  uint32_t line = 0;
  float length_px = 0.0f;  // of the part inside the enlarged image
};

/// Immutable after construction; queries are thread-safe and deterministic. Holds copies of what
/// decides visibility, in the order in which queries read it: about 100 bytes a line and 20 a
/// sighting.
class MapIndex {
 public:
  /// `map` is borrowed and must outlive the index.
  explicit MapIndex(const LineMap& map);
  ~MapIndex();
  MapIndex(MapIndex&&) noexcept;
  MapIndex& operator=(MapIndex&&) noexcept;

  const LineMap& map() const;

  /// Ids of the fused lines visible from the pose, ascending, into `out_lines` (cleared first; no
  /// allocation once its capacity suffices).
  void VisibleLines(const Camera& camera, const Rigid3& cam_from_world,
                    const VisibilityOptions& options, std::vector<uint32_t>* out_lines) const;

  /// The same lines with their visible lengths, in an order that only the map decides.
  void VisibleLines(const Camera& camera, const Rigid3& cam_from_world,
                    const VisibilityOptions& options, std::vector<VisibleLine>* out_lines) const;

  /// The `count` key frames nearest to the pose, nearest first. Distance = centre distance [m] +
  /// angle between the optical axes [rad].
  void NearestKeyFrames(const Rigid3& cam_from_world, uint32_t count,
                        std::vector<uint32_t>* out_key_frames) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
