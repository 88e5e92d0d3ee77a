#include "plumb/runtime/refine_input_check.h"

#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <string>

namespace plumb {
namespace {

constexpr double kMaxGravitySigmaRad = 1.0;
constexpr double kUnitTolerance = 1e-3;
// Coordinates beyond this are not pixels of any image [px].
constexpr double kMaxPixel = 1e6;

Error Invalid(const std::string& what) { return {ErrorCode::kInvalidArgument, what}; }

bool IsPixel(const Eigen::Vector2d& p) {
  return std::abs(p.x()) < kMaxPixel && std::abs(p.y()) < kMaxPixel;  // False for NaN.
}

std::string Text(double value) {
  char number[32];
  std::snprintf(number, sizeof(number), "%.6g", value);
  return number;
}

// "(1.5, nan)"
std::string Text(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) {
    text += text.empty() ? "(" : ", ";
    text += Text(value);
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

Status CheckGravity(const GravityPrior& gravity, const std::string& name) {
  const auto is_direction = [](const Eigen::Vector3d& v) {
    return std::isfinite(v.squaredNorm()) && v.norm() > kMinSigma;
  };
  if (!is_direction(gravity.down_in_camera)) {
    return Invalid(name + ": gravity in the camera " + Text(gravity.down_in_camera) +
                   " is not a direction");
  }
  if (!is_direction(gravity.down_in_world)) {
    return Invalid(name + ": gravity in the world " + Text(gravity.down_in_world) +
                   " is not a direction");
  }
  if (!(gravity.sigma_rad >= kMinSigma && gravity.sigma_rad <= kMaxGravitySigmaRad)) {
    return Invalid(name + ": gravity uncertainty " + Text(gravity.sigma_rad) +
                   " rad is not in [1e-9, 1]");
  }
  return Ok();
}

// `name` of the prior for messages.
Status CheckPrior(const PosePrior& prior, const std::string& name) {
  const Eigen::Quaterniond& q = prior.cam_from_world.rotation;
  if (!q.coeffs().allFinite() || !(std::abs(q.norm() - 1.0) < kUnitTolerance)) {
    return Invalid(name + ": rotation (x, y, z, w) = " + Text({q.x(), q.y(), q.z(), q.w()}) +
                   " is not a finite unit quaternion");
  }
  if (!prior.cam_from_world.translation.allFinite()) {
    return Invalid(name + ": translation " + Text(prior.cam_from_world.translation) +
                   " is not finite");
  }
  const auto in_range = [](double sigma, double max) { return sigma >= kMinSigma && sigma <= max; };
  if (!in_range(prior.position_sigma_m, kMaxPositionSigmaM)) {
    return Invalid(name + ".position_sigma_m " + Text(prior.position_sigma_m) +
                   " is not in [1e-9, 1000]");
  }
  if (!in_range(prior.rotation_sigma_rad, kMaxRotationSigmaRad)) {
    return Invalid(name + ".rotation_sigma_rad " + Text(prior.rotation_sigma_rad) +
                   " is not in [1e-9, 3.2]");
  }
  return prior.gravity ? CheckGravity(*prior.gravity, name) : Ok();
}

}  // namespace

Status CheckPriors(const PosePrior& prior, std::span<const PosePrior> more_priors) {
  if (Status status = CheckPrior(prior, "prior"); !status) return status;
  if (more_priors.size() > kMaxMorePriors) {
    return Invalid("more_priors has " + std::to_string(more_priors.size()) +
                   " entries, more than " + std::to_string(kMaxMorePriors));
  }
  for (size_t i = 0; i < more_priors.size(); ++i) {
    const std::string name = "more_priors[" + std::to_string(i) + "]";
    if (Status status = CheckPrior(more_priors[i], name); !status) return status;
  }
  return Ok();
}

Status CheckPoints(std::span<const PointMatch> points) {
  for (size_t i = 0; i < points.size(); ++i) {
    const PointMatch& point = points[i];
    const auto invalid = [i](const std::string& what) -> Status {
      return Invalid("points[" + std::to_string(i) + "] " + what);
    };
    if (!IsPixel(point.pixel)) {
      return invalid("at " + Text(point.pixel) + " is not in pixels of an image");
    }
    if (!point.point_in_world.allFinite() || !point.deviation_in_world.allFinite()) {
      return invalid("in the world " + Text(point.point_in_world) + " with deviation " +
                     Text(point.deviation_in_world) + " is not finite");
    }
  }
  return Ok();
}

Status CheckRefineInput(const RefineInput& input) {
  if (Status status = CheckCamera(input.camera); !status) return status;
  if (Status status = CheckPriors(input.prior, input.more_priors); !status) return status;
  for (size_t i = 0; i < input.segments.size(); ++i) {
    const Segment2& segment = input.segments[i];
    if (IsPixel(segment.start) && IsPixel(segment.end)) continue;
    return Invalid("segment " + std::to_string(i) + " from " + Text(segment.start) + " to " +
                   Text(segment.end) + " is not in pixels of an image");
  }
  return CheckPoints(input.points);
}

}  // namespace plumb
