// A corner of a room whose walls carry rectangles: rendered images and the exact map of their
// edges.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/line_projection.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/line_map.h"
#include "support/edge_image.h"

namespace plumb::testing {

/// Two walls and a floor, about 3 m in front of a camera at the identity pose. Equal seeds give
/// equal scenes.
class WallScene {
 public:
  explicit WallScene(unsigned seed = 1) {
    std::mt19937 random(seed);
    const Eigen::Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
    AddWall({-2.0, -1.6, 3.2}, x, y, 4.4, 3.0, 6, 4, &random);
    AddWall({-2.0, -1.6, 0.2}, z, y, 3.0, 3.0, 4, 4, &random);
    AddWall({-2.0, 1.4, 0.2}, x, z, 4.4, 3.0, 6, 3, &random);
  }

  Camera camera{290.0, 290.0, 159.5, 119.5, 320, 240};

  /// The image, each pixel the mean of 3 x 3 rays; with a lens, those that it lets through.
  GrayImage Render(const Rigid3& cam_from_world, const Lens& lens = {}) const {
    constexpr int kRays = 3;
    const Rectifier rectifier = *Rectifier::Create({camera, lens});
    GrayImage image(camera.width_px, camera.height_px);
    const Eigen::Matrix3d world_from_cam = cam_from_world.RotationMatrix().transpose();
    const Eigen::Vector3d centre = cam_from_world.Center();
    for (int v = 0; v < camera.height_px; ++v) {
      for (int u = 0; u < camera.width_px; ++u) {
        double sum = 0.0;
        for (int i = 0; i < kRays * kRays; ++i) {
          const Eigen::Vector2d px(u + (i % kRays + 0.5) / kRays - 0.5,
                                   v + (i / kRays + 0.5) / kRays - 0.5);
          const auto ideal = rectifier.ToIdeal(px);
          if (!ideal) continue;
          sum += Shade(centre, world_from_cam * rectifier.ideal().Normalize(*ideal).homogeneous());
        }
        image.At(u, v) = static_cast<uint8_t>(std::lround(sum / (kRays * kRays)));
      }
    }
    return image;
  }

  /// What a perfect builder would make of key frames at these poses.
  LineMap MakeMap(std::span<const Rigid3> key_frame_poses) const {
    LineMap map;
    map.detector = "lsd";
    for (size_t k = 0; k < key_frame_poses.size(); ++k) {
      KeyFrame key_frame;
      key_frame.timestamp_ns = static_cast<int64_t>(k + 1) * 1'000'000'000;
      key_frame.cam_from_world = key_frame_poses[k];
      key_frame.camera = camera;
      map.key_frames.push_back(key_frame);
    }
    for (const Segment3& edge : edges_) AddLine(edge, &map);
    return map;
  }

  /// Key frames that look at the corner from places 30 cm around the origin.
  static std::vector<Rigid3> KeyFramePoses() {
    std::vector<Rigid3> poses;
    for (int i = 0; i < 5; ++i) {
      const double a = 1.2 * i;
      const Eigen::Vector3d centre(0.3 * std::cos(a), 0.2 * std::sin(a), 0.15 * std::sin(2 * a));
      const Eigen::Quaterniond rotation =
          ExpSo3({0.05 * std::sin(a), 0.2 + 0.06 * std::cos(a), 0.03 * std::sin(3 * a)});
      poses.push_back({rotation, -(rotation * centre)});
    }
    return poses;
  }

 private:
  struct Wall {
    Eigen::Vector3d origin, u, v, normal;
    double size_u = 0.0, size_v = 0.0;
  };
  struct Rectangle {
    size_t wall = 0;
    double u0 = 0.0, u1 = 0.0, v0 = 0.0, v1 = 0.0;
    double grey = 0.0;
  };

  void AddWall(const Eigen::Vector3d& origin, const Eigen::Vector3d& u, const Eigen::Vector3d& v,
               double size_u, double size_v, int columns, int rows, std::mt19937* random) {
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>((*random)()) / 4294967295.0;
    };
    walls_.push_back({origin, u, v, u.cross(v), size_u, size_v});
    const double cell_u = size_u / columns, cell_v = size_v / rows;
    for (int c = 0; c < columns; ++c) {
      for (int r = 0; r < rows; ++r) {
        const Rectangle rectangle{walls_.size() - 1,
                                  (c + uniform(0.08, 0.3)) * cell_u,
                                  (c + uniform(0.6, 0.95)) * cell_u,
                                  (r + uniform(0.08, 0.3)) * cell_v,
                                  (r + uniform(0.6, 0.95)) * cell_v,
                                  uniform(0.0, 1.0) < 0.5 ? uniform(20, 70) : uniform(190, 240)};
        rectangles_.push_back(rectangle);
        const auto point = [&](double a, double b) -> Eigen::Vector3d {
          return origin + a * u + b * v;
        };
        const Eigen::Vector3d corners[4] = {
            point(rectangle.u0, rectangle.v0), point(rectangle.u1, rectangle.v0),
            point(rectangle.u1, rectangle.v1), point(rectangle.u0, rectangle.v1)};
        for (size_t i = 0; i < 4; ++i) edges_.push_back({corners[i], corners[(i + 1) % 4]});
      }
    }
  }

  double Shade(const Eigen::Vector3d& centre, const Eigen::Vector3d& ray) const {
    double nearest = std::numeric_limits<double>::infinity(), grey = 0.0;
    for (size_t w = 0; w < walls_.size(); ++w) {
      const Wall& wall = walls_[w];
      const double t = wall.normal.dot(wall.origin - centre) / wall.normal.dot(ray);
      if (!(t > 0.0 && t < nearest)) continue;
      const Eigen::Vector3d hit = centre + t * ray - wall.origin;
      const double u = wall.u.dot(hit), v = wall.v.dot(hit);
      if (u < 0.0 || v < 0.0 || u > wall.size_u || v > wall.size_v) continue;
      nearest = t;
      grey = 120.0;
      for (const Rectangle& r : rectangles_) {
        if (r.wall == w && u > r.u0 && u < r.u1 && v > r.v0 && v < r.v1) grey = r.grey;
      }
    }
    return grey;
  }

  void AddLine(const Segment3& edge, LineMap* map) const {
    MapLine line;
    line.segment_in_world = edge;
    const Eigen::Vector3d direction = edge.Delta().normalized();
    line.covariance_start = line.covariance_end =
        1e-6 * (Eigen::Matrix3d::Identity() - direction * direction.transpose());
    const uint32_t id = static_cast<uint32_t>(map->lines.size());
    for (size_t k = 0; k < map->key_frames.size(); ++k) {
      KeyFrame& key_frame = map->key_frames[k];
      const auto visible = ProjectSegment(key_frame.camera, key_frame.cam_from_world, edge, 0.0);
      if (!visible || visible->Length() < 12.0) continue;
      key_frame.segments.push_back({*visible, edge, id});
      const Eigen::Vector3d to_camera = key_frame.cam_from_world.Center() - edge.Midpoint();
      map->sightings.push_back({static_cast<uint32_t>(k), to_camera.normalized().cast<float>(),
                                static_cast<float>(to_camera.norm())});
      ++line.num_observing;
      ++line.num_expected;
    }
    if (line.num_observing == 0) return;
    map->lines.push_back(line);
    map->sighting_begin.push_back(static_cast<uint32_t>(map->sightings.size()));
  }

  std::vector<Wall> walls_;
  std::vector<Rectangle> rectangles_;
  std::vector<Segment3> edges_;
};

}  // namespace plumb::testing
