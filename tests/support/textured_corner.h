// Renders a textured wall and floor with depth, for tests of point features.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"

namespace plumb::testing {

struct RenderedView {
  Camera camera;
  Rigid3 cam_from_world;
  std::vector<uint8_t> gray;
  std::vector<float> depth_m;  // along the optical axis, 0 where there is nothing
};

/// Wall at z = 3 m, floor at y = 1 m (y points down), both covered with round spots of random size,
/// brightness and place.
class TexturedCorner {
 public:
  explicit TexturedCorner(unsigned seed) : texture_(kSide * kSide, 128.0f) {
    std::mt19937 rng(seed);
    std::uniform_real_distribution<float> at(0.0f, kSide), radius(3.0f, 14.0f),
        contrast(-70.0f, 70.0f);
    for (int spot = 0; spot < 4000; ++spot) {
      const float x = at(rng), y = at(rng), r = radius(rng), c = contrast(rng);
      for (int v = static_cast<int>(y - 2 * r); v <= static_cast<int>(y + 2 * r); ++v) {
        for (int u = static_cast<int>(x - 2 * r); u <= static_cast<int>(x + 2 * r); ++u) {
          const float dx = static_cast<float>(u) - x, dy = static_cast<float>(v) - y;
          texture_[Index(u, v)] += c * std::exp(-(dx * dx + dy * dy) / (0.5f * r * r));
        }
      }
    }
  }

  RenderedView Render(const Camera& camera, const Rigid3& cam_from_world) const {
    RenderedView view = {camera, cam_from_world, {}, {}};
    const Rigid3 world_from_cam = cam_from_world.Inverse();
    const Eigen::Vector3d center = cam_from_world.Center();
    for (int y = 0; y < camera.height_px; ++y) {
      for (int x = 0; x < camera.width_px; ++x) {
        const Eigen::Vector3d ray =
            world_from_cam.rotation *
            Eigen::Vector3d(camera.Normalize(Eigen::Vector2d(x, y)).homogeneous());
        // The ray's parameter is the depth, for its length along the optical axis is 1.
        const double wall = ray.z() > 0.0 ? (3.0 - center.z()) / ray.z() : INFINITY;
        const double floor = ray.y() > 0.0 ? (1.0 - center.y()) / ray.y() : INFINITY;
        const double depth = std::min(wall, floor);
        if (!(depth > 0.0) || !std::isfinite(depth)) {
          view.gray.push_back(0);
          view.depth_m.push_back(0.0f);
          continue;
        }
        const Eigen::Vector3d point = center + depth * ray;
        const double across = wall < floor ? point.y() : point.z() + 50.0;
        const float value = Sample(kPerMetre * point.x(), kPerMetre * across);
        view.gray.push_back(static_cast<uint8_t>(std::clamp(value + 0.5f, 0.0f, 255.0f)));
        view.depth_m.push_back(static_cast<float>(depth));
      }
    }
    return view;
  }

 private:
  static constexpr int kSide = 1024;          // texels, repeated
  static constexpr double kPerMetre = 170.0;  // texels: about one a pixel at 3 m

  static size_t Index(int u, int v) {
    return static_cast<size_t>((v & (kSide - 1)) * kSide + (u & (kSide - 1)));
  }
  float Sample(double x, double y) const {
    const double u = std::floor(x), v = std::floor(y);
    const auto fx = static_cast<float>(x - u), fy = static_cast<float>(y - v);
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const auto row = [&](int k) {
      return (1.0f - fx) * texture_[Index(i, k)] + fx * texture_[Index(i + 1, k)];
    };
    return (1.0f - fy) * row(j) + fy * row(j + 1);
  }

  std::vector<float> texture_;
};

}  // namespace plumb::testing
