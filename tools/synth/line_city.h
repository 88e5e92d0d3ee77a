// A map of many rooms made of lines only, and frames in it: as large as wanted, without images.
#pragma once

#include <cstdint>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/line_map.h"
#include "tools/synth/random.h"

namespace plumb::synth {

struct LineCityOptions {
  uint32_t num_lines = 100'000;  // rounded up to whole rooms of 2000
  uint64_t seed = 1;
};

/// Rooms of 6 x 6 x 2.8 m on a square grid, full of boxes and panels, with 25 key frames each; the
/// world's y axis points down. Lines carry sightings, key frames their own segments with the noise
/// of a depth camera.
class LineCity {
 public:
  explicit LineCity(const LineCityOptions& options);

  static Camera MakeCamera() { return {525.0, 525.0, 319.5, 239.5, 640, 480}; }
  const LineMap& map() const { return map_; }

  struct Point {
    Eigen::Vector2d pixel;
    Eigen::Vector3d point_in_world;
    Eigen::Vector3d deviation_in_world;
  };
  struct Frame {
    Rigid3 cam_from_world;
    std::vector<Segment2> segments;
    std::vector<Point> points;  // every fifth is wrong
  };
  /// What a camera near a random key frame detects: `num_segments` segments, a sixth of them of
  /// nothing, and `num_points` points.
  Frame MakeFrame(uint32_t num_segments, uint32_t num_points, Random* random) const;

 private:
  void AddRoom(const Eigen::Vector3d& corner, Random* random);
  void AddKeyFrames(const Eigen::Vector3d& corner, uint32_t first_line, Random* random);

  LineMap map_;
};

}  // namespace plumb::synth
