// A furnished room of straight lines: its map, as if built without error, and what a camera sees.
//
// Nothing hides anything: every line in front of the camera is visible.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/line_projection.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"
#include "plumb/map/line_map.h"
#include "plumb/search/random.h"

namespace plumb::testing {

inline Camera RoomCamera() { return {525.0, 525.0, 319.5, 239.5, 640, 480}; }

inline double UniformIn(Random* random, double low, double high) {
  return low + (high - low) * static_cast<double>(random->Uniform());
}

/// Pose of a camera at `center` that looks along `forward`, upright; z is up in the world.
inline Rigid3 LookAlong(const Eigen::Vector3d& center, const Eigen::Vector3d& forward) {
  const Eigen::Vector3d z = forward.normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d rotation;
  rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  return {Eigen::Quaterniond(rotation).normalized(), -(rotation * center)};
}

/// A pose whose camera centre and rotation are off by vectors of the given norms.
inline Rigid3 Disturb(const Rigid3& cam_from_world, double position_m, double rotation_rad,
                      Random* random) {
  const Eigen::Vector3d shift = position_m * random->Normal3(1.0f).cast<double>().normalized();
  const Eigen::Vector3d turn = rotation_rad * random->Normal3(1.0f).cast<double>().normalized();
  const Eigen::Quaterniond rotation = (ExpSo3(turn) * cam_from_world.rotation).normalized();
  return {rotation, -(rotation * (cam_from_world.Center() + shift))};
}

inline void AppendRectangle(const Eigen::Vector3d& corner, const Eigen::Vector3d& a,
                            const Eigen::Vector3d& b, std::vector<Segment3>* lines) {
  lines->push_back({corner, corner + a});
  lines->push_back({corner + b, corner + a + b});
  lines->push_back({corner, corner + b});
  lines->push_back({corner + a, corner + a + b});
}

/// Lines of a room of 6 x 5 x 2.6 m around the origin: its edges, pictures and shelves on the
/// walls (some askew), boxes on the floor.
inline std::vector<Segment3> RoomLines(uint64_t seed = 1) {
  Random random(seed);
  std::vector<Segment3> lines;
  const Eigen::Vector3d half(3.0, 2.5, 1.3);
  for (const double z : {-half.z(), half.z()}) {
    AppendRectangle({-half.x(), -half.y(), z}, {2 * half.x(), 0, 0}, {0, 2 * half.y(), 0}, &lines);
  }
  for (int wall = 0; wall < 4; ++wall) {
    const bool along_x = wall % 2 == 0;
    const double side = wall < 2 ? 1.0 : -1.0;
    const Eigen::Vector3d along = along_x ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    const double reach = along_x ? half.x() : half.y();
    const Eigen::Vector3d on_wall =
        along_x ? Eigen::Vector3d(0, side * half.y(), 0) : Eigen::Vector3d(side * half.x(), 0, 0);
    lines.push_back({on_wall + reach * along - half.z() * Eigen::Vector3d::UnitZ(),
                     on_wall + reach * along + half.z() * Eigen::Vector3d::UnitZ()});
    for (int k = 0; k < 14; ++k) {
      const Eigen::Vector3d corner = on_wall + UniformIn(&random, -reach, reach - 0.8) * along +
                                     UniformIn(&random, -1.2, 0.6) * Eigen::Vector3d::UnitZ();
      const double turn = k % 5 == 0 ? UniformIn(&random, -0.3, 0.3) : 0.0;
      const Eigen::Vector3d a = std::cos(turn) * along + std::sin(turn) * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d b = -std::sin(turn) * along + std::cos(turn) * Eigen::Vector3d::UnitZ();
      AppendRectangle(corner, UniformIn(&random, 0.2, 0.9) * a, UniformIn(&random, 0.2, 0.7) * b,
                      &lines);
    }
  }
  for (int k = 0; k < 6; ++k) {
    const Eigen::Vector3d corner(UniformIn(&random, -2.5, 2.0), UniformIn(&random, -2.2, 1.6),
                                 -1.3);
    const Eigen::Vector3d size(UniformIn(&random, 0.3, 0.8), UniformIn(&random, 0.3, 0.8),
                               UniformIn(&random, 0.3, 0.8));
    for (const double z : {0.0, size.z()}) {
      AppendRectangle(corner + z * Eigen::Vector3d::UnitZ(), {size.x(), 0, 0}, {0, size.y(), 0},
                      &lines);
    }
    for (int c = 0; c < 4; ++c) {
      const Eigen::Vector3d foot =
          corner + Eigen::Vector3d((c & 1) * size.x(), (c >> 1) * size.y(), 0);
      lines.push_back({foot, foot + size.z() * Eigen::Vector3d::UnitZ()});
    }
  }
  return lines;
}

/// A fence in the plane x = 3 m: posts that repeat every `period_m` along y, rails that do not.
inline std::vector<Segment3> FenceLines(double period_m) {
  std::vector<Segment3> lines;
  for (double y = -6.0; y < 6.01; y += period_m) lines.push_back({{3.0, y, -4.0}, {3.0, y, 4.0}});
  for (const double z : {-1.37, -0.91, -0.62, -0.4, -0.05, 0.31, 0.44, 0.83, 1.12, 1.6}) {
    lines.push_back({{3.0, -6.0, z}, {3.0, 6.0, z}});
  }
  return lines;
}

/// The part of a line that the camera sees.
inline std::optional<Segment3> VisiblePart(const Camera& camera, const Rigid3& cam_from_world,
                                           const Segment3& line) {
  constexpr int kSteps = 400;
  std::optional<int> first, last;
  for (int k = 0; k <= kSteps; ++k) {
    const Eigen::Vector3d x = cam_from_world * (line.start + double(k) / kSteps * line.Delta());
    if (!(x.z() > 0.2) || !camera.Contains(camera.Project(x))) continue;
    if (!first) first = k;
    last = k;
  }
  if (!first || *last == *first) return std::nullopt;
  return Segment3{line.start + double(*first) / kSteps * line.Delta(),
                  line.start + double(*last) / kSteps * line.Delta()};
}

/// Key frames at a 4 x 3 grid of places, each looking four ways.
inline std::vector<Rigid3> RoomKeyFrames() {
  std::vector<Rigid3> poses;
  for (const double x : {-1.5, -0.5, 0.5, 1.5}) {
    for (const double y : {-1.0, 0.0, 1.0}) {
      for (int k = 0; k < 4; ++k) {
        const double angle = k * std::numbers::pi / 2 + 0.2;
        poses.push_back(LookAlong({x, y, 0.1}, {std::cos(angle), std::sin(angle), -0.1}));
      }
    }
  }
  return poses;
}

/// Views of one half of the room from places 2 m across; any two have most of their lines in
/// common.
inline std::vector<Rigid3> RoomSweep(int count) {
  std::vector<Rigid3> poses;
  for (int k = 0; k < count; ++k) {
    const double s = 2.0 * std::numbers::pi * k / count, yaw = 0.6 * std::sin(3.0 * s);
    poses.push_back(
        LookAlong({-1.0 + 0.8 * std::cos(s), std::sin(s), 0.1 + 0.2 * std::cos(5.0 * s)},
                  {std::cos(yaw), std::sin(yaw), -0.1 + 0.1 * std::sin(s)}));
  }
  return poses;
}

/// The map that perfect key frames would give: exact lines that claim `sigma_m` of uncertainty.
inline LineMap MapOf(const std::vector<Segment3>& lines, const std::vector<Rigid3>& key_frames,
                     double sigma_m = 0.002) {
  const Camera camera = RoomCamera();
  LineMap map;
  map.detector = "synthetic";
  for (const Rigid3& pose : key_frames) {
    KeyFrame& key_frame = map.key_frames.emplace_back();
    key_frame.timestamp_ns = static_cast<int64_t>(map.key_frames.size());
    key_frame.cam_from_world = pose;
    key_frame.camera = camera;
  }
  for (const Segment3& segment : lines) {
    MapLine line;
    line.segment_in_world = segment;
    const Eigen::Vector3d d = segment.Delta().normalized();
    line.covariance_start = line.covariance_end =
        sigma_m * sigma_m * (Eigen::Matrix3d::Identity() - d * d.transpose());
    for (uint32_t k = 0; k < key_frames.size(); ++k) {
      const auto part = VisiblePart(camera, key_frames[k], segment);
      if (!part) continue;
      const Segment2 image{camera.Project(key_frames[k] * part->start),
                           camera.Project(key_frames[k] * part->end)};
      if (image.Length() < 15.0) continue;
      map.key_frames[k].segments.push_back({image, *part, static_cast<uint32_t>(map.lines.size())});
      const Eigen::Vector3d view = key_frames[k].Center() - segment.Midpoint();
      map.sightings.push_back(
          {k, view.normalized().cast<float>(), static_cast<float>(view.norm())});
      line.num_observing = ++line.num_expected;
    }
    map.sighting_begin.push_back(static_cast<uint32_t>(map.sightings.size()));
    map.lines.push_back(line);
  }
  return map;
}

struct RenderOptions {
  double noise_px = 0.3;        // of every end point coordinate
  double missing_share = 0.2;   // of the lines that are not detected
  double fragment_share = 0.3;  // of the lines that are detected in two parts
  uint32_t num_clutter = 30;    // segments of nothing
};

inline Segment2 RandomSegment(const Camera& camera, Random* random) {
  const Eigen::Vector2d middle(UniformIn(random, 0, camera.width_px),
                               UniformIn(random, 0, camera.height_px));
  const double angle = UniformIn(random, 0, std::numbers::pi), half = UniformIn(random, 8, 60);
  const Eigen::Vector2d reach = half * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  return {middle - reach, middle + reach};
}

/// The segments that a detector would find, > 12 px, in random order of their ends.
inline std::vector<Segment2> Render(const std::vector<Segment3>& lines, const Rigid3& pose,
                                    uint64_t seed, const RenderOptions& options = {}) {
  Random random(seed);
  const Camera camera = RoomCamera();
  std::vector<Segment2> segments;
  const auto add = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    const auto noise = [&]() -> Eigen::Vector2d {
      return random.Normal3(static_cast<float>(options.noise_px)).head<2>().cast<double>();
    };
    Segment2 segment{a + noise(), b + noise()};
    if (random.Below(2) == 0) std::swap(segment.start, segment.end);
    if (segment.Length() > 12.0) segments.push_back(segment);
  };
  for (const Segment3& line : lines) {
    const auto part = VisiblePart(camera, pose, line);
    if (!part || random.Uniform() < options.missing_share) continue;
    const Eigen::Vector2d a = camera.Project(pose * part->start);
    const Eigen::Vector2d b = camera.Project(pose * part->end);
    if (random.Uniform() < options.fragment_share) {
      const double cut = UniformIn(&random, 0.3, 0.7);
      add(a, a + (cut - 0.03) * (b - a));
      add(a + (cut + 0.03) * (b - a), b);
    } else {
      add(a, b);
    }
  }
  for (uint32_t k = 0; k < options.num_clutter; ++k) {
    segments.push_back(RandomSegment(camera, &random));
  }
  return segments;
}

}  // namespace plumb::testing
