#include "plumb/geometry/epipolar.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace plumb {
namespace {

// Baselines shorter than this give epipolar lines of pure noise [m].
constexpr double kMinBaseline = 1e-6;
// |sin| between an epipolar line and the segment below which their intersection is not usable.
constexpr double kMinCrossingSine = 0.02;
// An epipole this near to a segment cannot constrain it [px].
constexpr double kEpipoleMarginPx = 2.0;
// Shorter segments have no direction [px].
constexpr double kMinLengthPx = 1e-6;

Eigen::Matrix3d InverseCalibration(const Camera& camera) {
  Eigen::Matrix3d inverse;
  inverse << 1.0 / camera.fx, 0.0, -camera.cx / camera.fx,  //
      0.0, 1.0 / camera.fy, -camera.cy / camera.fy,         //
      0.0, 0.0, 1.0;
  return inverse;
}

// Image of a point of the camera's frame; defined for points at infinity and behind, too.
Eigen::Vector3d HomogeneousImage(const Camera& camera, const Eigen::Vector3d& x_in_cam) {
  return {camera.fx * x_in_cam.x() + camera.cx * x_in_cam.z(),
          camera.fy * x_in_cam.y() + camera.cy * x_in_cam.z(), x_in_cam.z()};
}

bool Touches(const Eigen::Vector3d& epipole, const Segment2& segment) {
  if (std::abs(epipole.z()) <= 1e-9 * epipole.norm()) return false;  // At infinity.
  const Eigen::Vector2d point = epipole.hnormalized();
  const Eigen::Vector2d delta = segment.Delta();
  const double length_squared = std::max(delta.squaredNorm(), kMinLengthPx * kMinLengthPx);
  const double u = std::clamp((point - segment.start).dot(delta) / length_squared, 0.0, 1.0);
  return (segment.start + u * delta - point).norm() < kEpipoleMarginPx;
}

}  // namespace

std::optional<EpipolarGeometry> EpipolarGeometry::Create(const Camera& camera_a,
                                                         const Rigid3& a_from_world,
                                                         const Camera& camera_b,
                                                         const Rigid3& b_from_world) {
  if (!camera_a.IsValid() || !camera_b.IsValid()) return std::nullopt;
  const Rigid3 b_from_a = b_from_world * a_from_world.Inverse();
  if (!b_from_a.IsFinite() || !(b_from_a.translation.norm() > kMinBaseline)) return std::nullopt;
  EpipolarGeometry geometry;
  geometry.fundamental_ = InverseCalibration(camera_b).transpose() * Hat(b_from_a.translation) *
                          b_from_a.RotationMatrix() * InverseCalibration(camera_a);
  geometry.fundamental_ /= geometry.fundamental_.norm();
  geometry.epipole_a_ = HomogeneousImage(camera_a, b_from_a.Inverse().translation);
  geometry.epipole_b_ = HomogeneousImage(camera_b, b_from_a.translation);
  return geometry;
}

std::optional<EpipolarBand> EpipolarGeometry::BandOf(const Segment2& a) const {
  if (!(a.Length() > kMinLengthPx) || Touches(epipole_a_, a)) return std::nullopt;
  EpipolarBand band{fundamental_ * a.start.homogeneous(), fundamental_ * a.end.homogeneous()};
  band.start /= band.start.head<2>().norm();
  band.end /= band.end.head<2>().norm();
  if (!band.start.allFinite() || !band.end.allFinite()) return std::nullopt;
  return band;
}

bool EpipolarGeometry::EpipoleTouches(const Segment2& b) const { return Touches(epipole_b_, b); }

std::optional<double> BandOverlap(const EpipolarBand& band, const Segment2& b) {
  const double length = b.Length();
  if (!(length > kMinLengthPx)) return std::nullopt;
  const Eigen::Vector2d direction = b.Delta() / length;
  const auto cut = [&](const Eigen::Vector3d& line, double crossing) {
    return -(line.head<2>().dot(b.start) + line.z()) / crossing;
  };
  const double start_crossing = band.start.head<2>().dot(direction);
  const double end_crossing = band.end.head<2>().dot(direction);
  if (!(std::abs(start_crossing) > kMinCrossingSine) ||
      !(std::abs(end_crossing) > kMinCrossingSine)) {
    return std::nullopt;
  }
  const double at_start = cut(band.start, start_crossing);
  const double at_end = cut(band.end, end_crossing);
  const double low = std::min(at_start, at_end);
  const double high = std::max(at_start, at_end);
  const double inner = std::min(high, length) - std::max(low, 0.0);
  const double outer = std::max(high, length) - std::min(low, 0.0);
  if (outer < 1.0) return 0.0;  // Less than a pixel in all: no evidence.
  return std::max(inner, 0.0) / outer;
}

}  // namespace plumb
