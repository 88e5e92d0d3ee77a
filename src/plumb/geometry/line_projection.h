// Projection of 3D lines into a pinhole image.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// Line a*u + b*v + c = 0 with a^2 + b^2 = 1, hence SignedDistance() is in pixels.
struct ImageLine {
  Eigen::Vector3d abc = Eigen::Vector3d::Zero();

  double SignedDistance(const Eigen::Vector2d& point_px) const {
    return abc.head<2>().dot(point_px) + abc.z();
  }
};

/// Lines whose image is a point or lies at infinity have no usable projection: with a, b the two
/// points in the camera and n = a x b, that is |n_xy| <= kMinRaySine * |a| * |b|. Scale-free.
inline constexpr double kMinRaySine = 1e-9;

/// Points nearer than this to the camera plane are clipped away before projection [m].
inline constexpr double kNearPlane = 0.1;

/// Projects the infinite line through `segment_in_cam`.
/// @return the image line, or nullopt if the line meets the optical centre, lies in the focal
///         plane, or the two points coincide (see kMinRaySine).
/// Source: Hartley & Zisserman, 2nd ed., Sec. 8.1.2.
std::optional<ImageLine> ProjectLine(const Camera& camera, const Segment3& segment_in_cam);

/// Projects a segment, clipped to z >= kNearPlane and to the image enlarged by `margin_px`.
/// @return the visible part [px], or nullopt if nothing of it is visible or a number is not finite.
std::optional<Segment2> ProjectSegment(const Camera& camera, const Rigid3& cam_from_world,
                                       const Segment3& segment_in_world, double margin_px = 0.0);

/// The same for a segment in camera coordinates.
std::optional<Segment2> ProjectSegmentInCam(const Camera& camera, const Segment3& segment_in_cam,
                                            double margin_px = 0.0);

}  // namespace plumb
