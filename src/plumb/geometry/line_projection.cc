#include "plumb/geometry/line_projection.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumb {

std::optional<ImageLine> ProjectLine(const Camera& camera, const Segment3& segment_in_cam) {
  const Eigen::Vector3d& a = segment_in_cam.start;
  const Eigen::Vector3d& b = segment_in_cam.end;
  const Eigen::Vector3d n = a.cross(b);  // Normal of the plane through line and optical centre.
  if (!(n.head<2>().norm() > kMinRaySine * a.norm() * b.norm())) {  // Also rejects NaN.
    return std::nullopt;
  }
  Eigen::Vector3d line(n.x() / camera.fx, n.y() / camera.fy, n.z());  // K^-T * n
  line.z() -= camera.cx * line.x() + camera.cy * line.y();
  return ImageLine{line / line.head<2>().norm()};
}

std::optional<Segment2> ProjectSegment(const Camera& camera, const Rigid3& cam_from_world,
                                       const Segment3& segment_in_world, double margin_px) {
  return ProjectSegmentInCam(
      camera, {cam_from_world * segment_in_world.start, cam_from_world * segment_in_world.end},
      margin_px);
}

std::optional<Segment2> ProjectSegmentInCam(const Camera& camera, const Segment3& segment_in_cam,
                                            double margin_px) {
  Eigen::Vector3d a = segment_in_cam.start;
  Eigen::Vector3d b = segment_in_cam.end;
  if (!(a.z() > kNearPlane || b.z() > kNearPlane)) return std::nullopt;
  if (!std::isfinite((a + b).sum())) return std::nullopt;  // the clipping below would hide it
  const auto clip_to_near = [](const Eigen::Vector3d& inside, Eigen::Vector3d& outside) {
    outside = inside + (inside.z() - kNearPlane) / (inside.z() - outside.z()) * (outside - inside);
  };
  if (a.z() < kNearPlane) clip_to_near(b, a);
  if (b.z() < kNearPlane) clip_to_near(a, b);
  const Eigen::Vector2d start = camera.Project(a);
  const Eigen::Vector2d delta = camera.Project(b) - start;

  // Liang-Barsky against the four borders.
  double u0 = 0.0, u1 = 1.0;
  const double high[2] = {camera.width_px - 1 + margin_px, camera.height_px - 1 + margin_px};
  for (int k = 0; k < 2; ++k) {
    if (std::abs(delta[k]) < 1e-12) {
      if (start[k] < -margin_px || start[k] > high[k]) return std::nullopt;
      continue;
    }
    double r0 = (-margin_px - start[k]) / delta[k];
    double r1 = (high[k] - start[k]) / delta[k];
    if (r0 > r1) std::swap(r0, r1);
    u0 = std::max(u0, r0);
    u1 = std::min(u1, r1);
  }
  if (!(u1 > u0)) return std::nullopt;
  return Segment2{start + u0 * delta, start + u1 * delta};
}

}  // namespace plumb
