#include "plumb/runtime/refine_input_check.h"

#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <string>

namespace plumb {
namespace {

// A prior this uncertain is no prior; a tighter one would divide by zero.
constexpr double kMaxPositionSigmaM = 1e3, kMaxRotationSigmaRad = 3.2, kMinSigma = 1e-9;
constexpr double kMaxGravitySigmaRad = 1.0;
constexpr double kUnitTolerance = 1e-3;
// Coordinates beyond this are not pixels of any image [px].
constexpr double kMaxPixel = 1e6;

Error Invalid(const std::string& what) { return {ErrorCode::kInvalidArgument, what}; }

bool IsPixel(const Eigen::Vector2d& p) {
  return std::abs(p.x()) < kMaxPixel && std::abs(p.y()) < kMaxPixel;  // False for NaN.
}

// "(1.5, nan)"
std::string Text(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) {
    char number[32];
    std::snprintf(number, sizeof(number), "%.6g", value);
    text += text.empty() ? "(" : ", ";
    text += number;
  }
  text += ")";
  return text;
}
std::string Text(const Eigen::Vector2d& p) { return Text({p.x(), p.y()}); }
std::string Text(const Eigen::Vector3d& p) { return Text({p.x(), p.y(), p.z()}); }

Status CheckCamera(const Camera& camera) {
  if (camera.IsValid()) return Ok();
  return Invalid(
      "camera with (fx, fy, cx, cy) = " + Text({camera.fx, camera.fy, camera.cx, camera.cy}) +
      " and " + std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) +
      " pixels is not a camera: focal lengths are finite and not 0, sizes positive");
}

Status CheckPrior(const PosePrior& prior) {
  const Eigen::Quaterniond& q = prior.cam_from_world.rotation;
  if (!q.coeffs().allFinite() || !(std::abs(q.norm() - 1.0) < kUnitTolerance)) {
    return Invalid("prior rotation (x, y, z, w) = " + Text({q.x(), q.y(), q.z(), q.w()}) +
                   " is not a finite unit quaternion");
  }
  if (!prior.cam_from_world.translation.allFinite()) {
    return Invalid("prior translation " + Text(prior.cam_from_world.translation) +
                   " is not finite");
  }
  const auto in_range = [](double sigma, double max) { return sigma >= kMinSigma && sigma <= max; };
  if (!in_range(prior.position_sigma_m, kMaxPositionSigmaM)) {
    return Invalid("prior position uncertainty " + std::to_string(prior.position_sigma_m) +
                   " m is not in (0, 1000]");
  }
  if (!in_range(prior.rotation_sigma_rad, kMaxRotationSigmaRad)) {
    return Invalid("prior rotation uncertainty " + std::to_string(prior.rotation_sigma_rad) +
                   " rad is not in (0, 3.2]");
  }
  return prior.gravity ? CheckGravity(*prior.gravity) : Ok();
}

}  // namespace

Status CheckGravity(const GravityPrior& gravity) {
  const auto is_direction = [](const Eigen::Vector3d& v) {
    return std::isfinite(v.squaredNorm()) && v.norm() > kMinSigma;
  };
  if (!is_direction(gravity.down_in_camera)) {
    return Invalid("prior gravity in the camera " + Text(gravity.down_in_camera) +
                   " is not a direction");
  }
  if (!is_direction(gravity.down_in_world)) {
    return Invalid("prior gravity in the world " + Text(gravity.down_in_world) +
                   " is not a direction");
  }
  if (!(gravity.sigma_rad >= kMinSigma && gravity.sigma_rad <= kMaxGravitySigmaRad)) {
    return Invalid("prior gravity uncertainty " + std::to_string(gravity.sigma_rad) +
                   " rad is not in (0, 1]");
  }
  return Ok();
}

Status CheckRefineInput(const RefineInput& input) {
  if (Status status = CheckCamera(input.camera); !status) return status;
  if (Status status = CheckPrior(input.prior); !status) return status;
  if (input.more_priors.size() > kMaxMorePriors) {
    return Invalid("more_priors has " + std::to_string(input.more_priors.size()) +
                   " entries, more than " + std::to_string(kMaxMorePriors));
  }
  for (size_t i = 0; i < input.more_priors.size(); ++i) {
    if (Status status = CheckPrior(input.more_priors[i]); !status) {
      return Invalid("more_priors[" + std::to_string(i) + "]: " + status.error().message);
    }
  }
  for (size_t i = 0; i < input.segments.size(); ++i) {
    const Segment2& segment = input.segments[i];
    if (IsPixel(segment.start) && IsPixel(segment.end)) continue;
    return Invalid("segment " + std::to_string(i) + " from " + Text(segment.start) + " to " +
                   Text(segment.end) + " is not in pixels of an image");
  }
  for (size_t i = 0; i < input.points.size(); ++i) {
    const PointMatch& point = input.points[i];
    if (!IsPixel(point.pixel)) {
      return Invalid("point " + std::to_string(i) + " at " + Text(point.pixel) +
                     " is not in pixels of an image");
    }
    if (!point.point_in_world.allFinite() || !point.deviation_in_world.allFinite()) {
      return Invalid("point " + std::to_string(i) + " in the world " + Text(point.point_in_world) +
                     " with deviation " + Text(point.deviation_in_world) + " is not finite");
    }
  }
  return Ok();
}

}  // namespace plumb
