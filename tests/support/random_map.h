// A consistent map with random content: a room of lines and a few key frames that look at it.
#pragma once

#include <cstdint>
#include <random>

#include "plumb/map/line_map.h"

namespace plumb::testing {

struct RandomMapSize {
  uint32_t lines = 3, key_frames = 2, segments_per_key_frame = 2, points_per_key_frame = 1;
};

/// Key frames lie within 2 m of `center`, lines within 4 m. Every second line is seen by each key
/// frame, the others by every second one.
inline LineMap MakeRandomMap(const RandomMapSize& size, unsigned seed,
                             const Eigen::Vector3d& center = {0.3, -0.2, 1.1}) {
  std::mt19937 rng(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng);
  };
  const auto vector = [&](double half) {
    return Eigen::Vector3d(uniform(-half, half), uniform(-half, half), uniform(-half, half));
  };
  LineMap map;
  map.detector = "lsd";
  map.depth_source = DepthSource::kViews;
  map.covariance_factor = 2.25;
  map.covariance_growth = 0.75;
  map.pose_change = PoseChange{0.004, 0.002};
  const Camera given{525.5, 525.0, 320.0, 240.0, 640, 480};
  const Camera corrected{523.7, 523.2, 319.6, 239.9, 640, 480};
  map.camera_correction =
      CameraCorrection{given, {corrected, {LensModel::kRadTan, {0.01, -0.05, 0.001, 0.0}}}};
  for (uint32_t k = 0; k < size.key_frames; ++k) {
    KeyFrame key_frame;
    key_frame.timestamp_ns = 1'000'000'000LL + 33'333'333LL * k;
    const Eigen::Quaterniond rotation = ExpSo3(vector(1.5));
    key_frame.cam_from_world = {rotation, -(rotation * (center + vector(2.0)))};
    key_frame.camera = {525.0, 524.5, 319.5, 239.5, 640, 480};
    for (uint32_t i = 0; i < size.segments_per_key_frame; ++i) {
      LiftedSegment segment;
      segment.segment_px = {
          {uniform(0, 639), uniform(0, 479)}, {uniform(0, 639), uniform(0, 479)}, uniform(0, 1)};
      segment.segment_in_world = {center + vector(4.0), center + vector(4.0)};
      if (i % 2 == 0 && size.lines > 0) segment.line = i % size.lines;
      key_frame.segments.push_back(segment);
    }
    for (uint32_t i = 0; i < size.points_per_key_frame; ++i) {
      MapPoint point;
      point.pixel = Eigen::Vector2d(uniform(0, 639), uniform(0, 479)).cast<float>();
      point.point_in_world = (center + vector(4.0)).cast<float>();
      for (uint8_t& value : point.descriptor) value = static_cast<uint8_t>(rng());
      key_frame.points.push_back(point);
    }
    map.key_frames.push_back(std::move(key_frame));
  }
  for (uint32_t i = 0; i < size.lines; ++i) {
    MapLine line;
    const Eigen::Vector3d midpoint = center + vector(3.0), half = vector(0.8);
    line.segment_in_world = {midpoint - half, midpoint + half};
    const Eigen::Vector3d direction = half.normalized();
    line.covariance_start =
        1e-6 * (Eigen::Matrix3d::Identity() - direction * direction.transpose());
    line.covariance_end = 4.0 * line.covariance_start;
    for (uint32_t k = 0; k < size.key_frames; k += 1 + i % 2) {
      const Eigen::Vector3d ray = map.key_frames[k].cam_from_world.Center() - midpoint;
      map.sightings.push_back({k, ray.normalized().cast<float>(), static_cast<float>(ray.norm())});
      ++line.num_observing;
    }
    line.num_expected = line.num_observing + i % 3;
    map.sighting_begin.push_back(static_cast<uint32_t>(map.sightings.size()));
    map.lines.push_back(line);
  }
  return map;
}

}  // namespace plumb::testing
