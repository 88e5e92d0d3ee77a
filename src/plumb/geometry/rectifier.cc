#include "plumb/geometry/rectifier.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace plumb {
namespace {

constexpr double kBorderStepPx = 8.0;
constexpr int kMaxSidePx = 16384;

}  // namespace

Result<Rectifier> Rectifier::Create(const ImageCamera& camera) {
  const Camera& pinhole = camera.pinhole;
  if (!pinhole.IsValid()) {
    return Error{ErrorCode::kInvalidArgument,
                 "the camera is not one: focal lengths are finite and not 0, sizes positive"};
  }
  Result<LensMapping> mapping = LensMapping::Create(camera.lens);
  if (!mapping) return mapping.error();
  Rectifier rectifier;
  rectifier.camera_ = camera;
  rectifier.ideal_ = pinhole;
  rectifier.mapping_ = *mapping;
  if (camera.lens.IsNone()) return rectifier;

  // The box around the undistorted border; where the border lies outside of what can be
  // undistorted, the edge of that counts.
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  const auto add = [&](double x, double y) {
    const Eigen::Vector2d distorted = pinhole.Normalize({x, y});
    const Eigen::Vector2d ideal =
        mapping->Undistort(distorted).value_or(distorted.normalized() * mapping->max_radius());
    const Eigen::Vector2d px(pinhole.fx * ideal.x() + pinhole.cx,
                             pinhole.fy * ideal.y() + pinhole.cy);
    low = low.cwiseMin(px);
    high = high.cwiseMax(px);
  };
  const double last_x = pinhole.width_px - 1, last_y = pinhole.height_px - 1;
  for (double x = 0.0; x < last_x + kBorderStepPx; x += kBorderStepPx) {
    add(std::min(x, last_x), 0.0);
    add(std::min(x, last_x), last_y);
  }
  for (double y = 0.0; y < last_y + kBorderStepPx; y += kBorderStepPx) {
    add(0.0, std::min(y, last_y));
    add(last_x, std::min(y, last_y));
  }
  const Eigen::Vector2d middle(0.5 * last_x, 0.5 * last_y);
  if (!mapping->Undistort(pinhole.Normalize(middle)) || !low.allFinite() || !high.allFinite()) {
    return Error{ErrorCode::kInvalidArgument,
                 "the distortion cannot be undone at the image's middle"};
  }
  // At most kMaxSidePx a side about the principal point: no lens needs more.
  low.x() = std::max(low.x(), pinhole.cx - 0.5 * kMaxSidePx);
  low.y() = std::max(low.y(), pinhole.cy - 0.5 * kMaxSidePx);
  const Eigen::Vector2d origin(std::floor(low.x()), std::floor(low.y()));
  const auto size = [](double from, double to) {
    return static_cast<int>(std::clamp(std::ceil(to - from) + 1.0, 1.0, double{kMaxSidePx}));
  };
  rectifier.ideal_.cx = pinhole.cx - origin.x();
  rectifier.ideal_.cy = pinhole.cy - origin.y();
  rectifier.ideal_.width_px = size(origin.x(), high.x());
  rectifier.ideal_.height_px = size(origin.y(), high.y());
  return rectifier;
}

std::optional<Eigen::Vector2d> Rectifier::ToIdeal(const Eigen::Vector2d& image_px) const {
  if (IsIdentity()) return image_px;
  const std::optional<Eigen::Vector2d> ideal =
      mapping_.Undistort(camera_.pinhole.Normalize(image_px));
  if (!ideal) return std::nullopt;
  return Eigen::Vector2d(ideal_.fx * ideal->x() + ideal_.cx, ideal_.fy * ideal->y() + ideal_.cy);
}

std::optional<ImagePoint> Rectifier::ToImage(const Eigen::Vector2d& ideal_px) const {
  if (IsIdentity()) return ImagePoint{ideal_px, Eigen::Matrix2d::Identity()};
  const std::optional<DistortedPoint> distorted = mapping_.Distort(ideal_.Normalize(ideal_px));
  if (!distorted) return std::nullopt;
  const Camera& pinhole = camera_.pinhole;
  ImagePoint out;
  out.px = {pinhole.fx * distorted->point.x() + pinhole.cx,
            pinhole.fy * distorted->point.y() + pinhole.cy};
  out.jacobian = distorted->jacobian;  // between coordinates on the plane z = 1
  out.jacobian(0, 1) *= pinhole.fx / pinhole.fy;
  out.jacobian(1, 0) *= pinhole.fy / pinhole.fx;
  return out;
}

}  // namespace plumb
