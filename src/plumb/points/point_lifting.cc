#include "plumb/points/point_lifting.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace plumb {
namespace {

/// Depth at a pixel whose surroundings agree [m].
std::optional<double> SmoothDepthAt(const DepthView& depth, const Eigen::Vector2f& pixel,
                                    const PointLiftOptions& options) {
  const int x = static_cast<int>(std::lround(pixel.x()));
  const int y = static_cast<int>(std::lround(pixel.y()));
  if (x < 0 || y < 0 || x >= depth.width_px || y >= depth.height_px) return std::nullopt;
  const double center = static_cast<double>(depth.MetresAt(x, y));
  if (!(center > options.min_depth_m && center < options.max_depth_m)) return std::nullopt;
  double least = center, most = center;
  for (const int dy : {-2, 0, 2}) {
    for (const int dx : {-2, 0, 2}) {
      const double value = static_cast<double>(depth.MetresAt(
          std::clamp(x + dx, 0, depth.width_px - 1), std::clamp(y + dy, 0, depth.height_px - 1)));
      least = std::min(least, value);  // 0 where there is none
      most = std::max(most, value);
    }
  }
  if (!(most - least < options.max_relative_spread * center)) return std::nullopt;
  return center;
}

}  // namespace

std::vector<MapPoint> LiftPoints(const ImagePoints& points, const Rectifier& rectifier,
                                 const Rigid3& cam_from_world, const DepthView& depth,
                                 const PointLiftOptions& options) {
  const Rigid3 world_from_cam = cam_from_world.Inverse();
  std::vector<MapPoint> lifted;
  lifted.reserve(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    const std::optional<double> z = SmoothDepthAt(depth, points.pixels[i], options);
    if (!z) continue;
    const auto pixel = rectifier.ToIdeal(points.pixels[i].cast<double>());
    if (!pixel) continue;
    const Eigen::Vector3d ray = rectifier.ideal().Normalize(*pixel).homogeneous();
    lifted.push_back(
        {pixel->cast<float>(), (world_from_cam * (*z * ray)).cast<float>(), points.descriptors[i]});
  }
  return lifted;
}

}  // namespace plumb
