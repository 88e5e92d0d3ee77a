// The line map: fused 3D lines with covariance and visibility, and the key frames they come from.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/camera_correction.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/depth_source.h"

namespace plumb {

/// A 3D line fused over the key frames that observed it.
struct MapLine {
  Segment3 segment_in_world;
  /// Covariance of the two anchor points [m^2], rank 2: free across the line only.
  Eigen::Matrix3d covariance_start = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d covariance_end = Eigen::Matrix3d::Zero();
  uint32_t num_observing = 0;  // key frames that observed the line
  uint32_t num_expected = 0;   // key frames in which it should be visible, >= num_observing
};

/// One key frame that observed a line, as seen from the line's midpoint.
struct LineSighting {
  uint32_t key_frame = 0;
  Eigen::Vector3f direction_to_camera = Eigen::Vector3f::Zero();  // unit, world frame
  float distance_m = 0.0f;
};

/// A segment of one key frame with the 3D segment that its own depth, or views near it, give it.
/// The last step of the refinement uses these, not the fused lines (they agree better with their
/// neighbourhood).
struct LiftedSegment {
  Segment2 segment_px;
  Segment3 segment_in_world;
  std::optional<uint32_t> line;  // fused line that it supports
};

/// A point of one key frame for the optional point front-end.
struct MapPoint {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  Eigen::Vector3f point_in_world = Eigen::Vector3f::Zero();
  std::array<uint8_t, 128> descriptor{};  // SIFT, as OpenCV scales it to bytes
};

struct KeyFrame {
  int64_t timestamp_ns = 0;
  Rigid3 cam_from_world;
  Camera camera;
  std::vector<LiftedSegment> segments;
  std::vector<MapPoint> points;
};

/// How far key-frame poses were moved: medians over the key frames.
struct PoseChange {
  double position_m = 0.0, rotation_rad = 0.0;
};

/// Factor on the pose covariance of a map that was not calibrated. A segment counts for every line
/// that it meets, a long one up to four times: with errors as claimed the squared error is 5.7
/// times what the residuals promise (tests/runtime/normalised_error_test.cc).
inline constexpr double kUncalibratedFactor = 6.0;

/// Plain data; MapIndex answers queries over it, map_file reads and writes it.
struct LineMap {
  std::vector<MapLine> lines;
  /// Sightings of line i: sightings[sighting_begin[i] .. sighting_begin[i + 1]).
  std::vector<uint32_t> sighting_begin{0};
  std::vector<LineSighting> sightings;
  std::vector<KeyFrame> key_frames;
  /// Detector that made the segments; a query should use the same one.
  std::string detector;
  DepthSource depth_source = DepthSource::kSensor;
  /// Factor on the pose covariance: covariance_factor + covariance_growth x distance to the nearest
  /// key frames [m + rad] (CovarianceFactor()).
  double covariance_factor = kUncalibratedFactor, covariance_growth = 0.0;
  /// Set when the key frames' poses were adjusted together with the lines, from those given.
  std::optional<PoseChange> pose_change;
  /// Set when the key frames' one camera was corrected; the key frames are of the corrected one.
  std::optional<CameraCorrection> camera_correction;

  /// What to take a camera for: the corrected one if `given` is the one that took the key frames.
  ImageCamera Corrected(const ImageCamera& given) const {
    return camera_correction && IsSameCamera(camera_correction->given, given)
               ? camera_correction->corrected
               : given;
  }

  std::span<const LineSighting> SightingsOf(uint32_t line) const {
    return std::span(sightings).subspan(sighting_begin[line],
                                        sighting_begin[line + 1] - sighting_begin[line]);
  }
};

}  // namespace plumb
