#include "plumb/map/line_cloud.h"

#include <array>
#include <optional>

#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr double kSlack = 1.001;  // against rounding: lines that touch the border count

// The visible frustum as four planes through the camera centre; unit normals pointing inside.
std::array<Eigen::Vector3d, 4> FrustumPlanes(const Camera& camera) {
  const auto plane = [](double x, double y, double z) {
    return Eigen::Vector3d(Eigen::Vector3d(x, y, z).normalized());
  };
  const double right = camera.cx - (camera.width_px - 1);
  const double bottom = camera.cy - (camera.height_px - 1);
  return {plane(camera.fx, 0.0, camera.cx), plane(-camera.fx, 0.0, -right),
          plane(0.0, camera.fy, camera.cy), plane(0.0, -camera.fy, -bottom)};
}

}  // namespace

LineCloud::Sphere LineCloud::Bound(const Segment3& line) {
  return {line.Midpoint(), 0.5 * kSlack * line.Length()};
}

void LineCloud::Add(const Segment3& line_in_world) {
  lines_.push_back(line_in_world);
  spheres_.push_back(Bound(line_in_world));
}

void LineCloud::Set(size_t line, const Segment3& line_in_world) {
  lines_[line] = line_in_world;
  spheres_[line] = Bound(line_in_world);
}

void LineCloud::Project(const Camera& camera, const Rigid3& cam_from_world, double min_length_px,
                        double max_depth_m, std::vector<ProjectedLine>* out_projected) const {
  out_projected->clear();
  const std::array<Eigen::Vector3d, 4> planes = FrustumPlanes(camera);
  const Eigen::Matrix3d rotation = cam_from_world.RotationMatrix();
  for (uint32_t i = 0; i < lines_.size(); ++i) {
    const Sphere& sphere = spheres_[i];
    const Eigen::Vector3d center = rotation * sphere.center + cam_from_world.translation;
    if (center.z() < -sphere.radius_m || center.z() - sphere.radius_m > max_depth_m) continue;
    bool outside = false;
    for (const Eigen::Vector3d& plane : planes) outside |= plane.dot(center) < -sphere.radius_m;
    if (outside) continue;
    const std::optional<Segment2> projected = ProjectSegment(camera, cam_from_world, lines_[i]);
    if (projected && projected->Length() > min_length_px) {
      out_projected->push_back({i, *projected});
    }
  }
}

}  // namespace plumb
