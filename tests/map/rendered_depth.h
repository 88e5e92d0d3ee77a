// Depth images of planar patches, for tests of the map builder.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/depth_view.h"

namespace plumb {

/// A parallelogram in the world: corner + a * side_a + b * side_b, 0 <= a, b <= 1.
struct Patch {
  Eigen::Vector3d corner, side_a, side_b;
};

struct DepthImage {
  int width_px = 0, height_px = 0;
  std::vector<float> metres;

  float& at(int x, int y) { return metres[static_cast<size_t>(y) * width_px + x]; }
  DepthView View() const {
    return {DepthFormat::kFloat,
            metres.data(),
            static_cast<int64_t>(width_px * sizeof(float)),
            width_px,
            height_px,
            1.0};
  }
};

/// Depth by formula: `depth_m(x, y)` for every pixel.
inline DepthImage MakeDepth(const Camera& camera, const std::function<double(int, int)>& depth_m) {
  DepthImage image{camera.width_px, camera.height_px, {}};
  for (int y = 0; y < camera.height_px; ++y) {
    for (int x = 0; x < camera.width_px; ++x) {
      image.metres.push_back(static_cast<float>(depth_m(x, y)));
    }
  }
  return image;
}

/// Depth of the nearest patch along each pixel's ray, 0 where there is none.
inline DepthImage RenderDepth(const Camera& camera, const Rigid3& cam_from_world,
                              const std::vector<Patch>& patches) {
  const Rigid3 world_from_cam = cam_from_world.Inverse();
  return MakeDepth(camera, [&](int x, int y) {
    const Eigen::Vector3d origin = world_from_cam.translation;
    const Eigen::Vector2d at = camera.Normalize({x, y});
    const Eigen::Vector3d ray = world_from_cam.rotation * Eigen::Vector3d(at.x(), at.y(), 1.0);
    double nearest = std::numeric_limits<double>::infinity();
    for (const Patch& patch : patches) {
      Eigen::Matrix3d system;  // origin + z ray = corner + a side_a + b side_b
      system << ray, -patch.side_a, -patch.side_b;
      if (std::abs(system.determinant()) < 1e-12) continue;
      const Eigen::Vector3d zab = system.inverse() * (patch.corner - origin);
      const bool inside = zab[1] >= 0.0 && zab[1] <= 1.0 && zab[2] >= 0.0 && zab[2] <= 1.0;
      if (zab[0] > 0.0 && inside && zab[0] < nearest) nearest = zab[0];
    }
    return std::isfinite(nearest) ? nearest : 0.0;
  });
}

}  // namespace plumb
