#include "plumb/map/view_neighbours.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumb {
namespace {

constexpr double kMinBaseline = 1e-6;  // [m] as in EpipolarGeometry

double AxisAngle(const Rigid3& a, const Rigid3& b) {
  const Eigen::Vector3d axis_a = a.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d axis_b = b.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  return std::acos(std::clamp(axis_a.dot(axis_b), -1.0, 1.0));
}

double Distance(const Rigid3& a, const Rigid3& b) {
  return (a.Center() - b.Center()).norm() + AxisAngle(a, b);
}

}  // namespace

std::vector<uint32_t> ViewNeighbours(std::span<const Rigid3> cam_from_world, uint32_t frame,
                                     const ViewNeighbourOptions& options) {
  const Rigid3& own = cam_from_world[frame];
  std::vector<std::pair<double, uint32_t>> candidates;
  for (uint32_t k = 0; k < cam_from_world.size(); ++k) {
    if (k == frame || AxisAngle(own, cam_from_world[k]) > options.max_axis_angle_rad) continue;
    if (!((own.Center() - cam_from_world[k].Center()).norm() > kMinBaseline)) continue;
    candidates.emplace_back(Distance(own, cam_from_world[k]), k);
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<uint32_t> chosen;
  for (const auto& [distance, k] : candidates) {
    if (chosen.size() == options.max_neighbours) break;
    const bool redundant = std::any_of(chosen.begin(), chosen.end(), [&](uint32_t other) {
      return Distance(cam_from_world[k], cam_from_world[other]) < options.min_spacing * distance;
    });
    if (!redundant) chosen.push_back(k);
  }
  return chosen;
}

}  // namespace plumb
