#include "plumb/runtime/frame_slot.h"

#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "plumb/runtime/rectify_points.h"
#include "plumb/runtime/refine_input_check.h"
#include "plumb/runtime/session.h"

namespace plumb {
namespace {

// Copies the planes without padding and points `image` at the copy.
void CopyImage(const ImageView& from, std::vector<uint8_t>* pixels, ImageView* image) {
  const size_t num_planes = static_cast<size_t>(NumPlanes(from.format));
  size_t num_bytes = 0;
  for (size_t i = 0; i < num_planes; ++i) {
    num_bytes += static_cast<size_t>(RowBytes(from.format, i, from.width_px)) *
                 static_cast<size_t>(NumRows(from.format, i, from.height_px));
  }
  pixels->resize(num_bytes);
  *image = from;
  uint8_t* out = pixels->data();
  for (size_t i = 0; i < num_planes; ++i) {
    const int64_t row_bytes = RowBytes(from.format, i, from.width_px);
    image->planes[i] = {out, row_bytes};
    const uint8_t* in = from.planes[i].data;
    for (int y = 0; y < NumRows(from.format, i, from.height_px); ++y) {
      std::memcpy(out, in, static_cast<size_t>(row_bytes));
      out += row_bytes;
      in += from.planes[i].row_stride_bytes;
    }
  }
}

Status Invalid(const std::string& message) {
  return Error{ErrorCode::kInvalidArgument, "SessionFrame: " + message};
}

// `name` of the prior for messages.
Status ValidatePrior(const PosePrior& prior, const std::string& name) {
  constexpr double kMaxQuaternionError = 1e-3;
  const Rigid3& pose = prior.cam_from_world;
  if (!pose.IsFinite()) return Invalid(name + ".cam_from_world is not finite");
  if (!(std::abs(pose.rotation.norm() - 1.0) < kMaxQuaternionError)) {
    return Invalid(name + ".cam_from_world.rotation has norm " +
                   std::to_string(pose.rotation.norm()) + ", not 1");
  }
  const auto is_positive = [](double x) { return std::isfinite(x) && x > 0.0; };
  if (!is_positive(prior.position_sigma_m)) {
    return Invalid(name + ".position_sigma_m " + std::to_string(prior.position_sigma_m) +
                   " is not positive");
  }
  if (!is_positive(prior.rotation_sigma_rad)) {
    return Invalid(name + ".rotation_sigma_rad " + std::to_string(prior.rotation_sigma_rad) +
                   " is not positive");
  }
  return prior.gravity ? CheckGravity(*prior.gravity) : Ok();
}

}  // namespace

void FrameSlot::Assign(const SessionFrame& frame, const Rectifier& frame_rectifier,
                       int64_t now_ns) {
  ticket.timestamp_ns = frame.timestamp_ns;
  ticket.user_tag = frame.user_tag;
  ticket.user_kind = frame.user_kind;
  ticket.prior = frame.prior;
  ticket.prior.cam_from_world.rotation.normalize();
  ticket.submitted_ns = now_ns;
  more_priors.assign(frame.more_priors.begin(), frame.more_priors.end());
  for (PosePrior& prior : more_priors) prior.cam_from_world.rotation.normalize();
  rectifier = frame_rectifier;
  points.assign(frame.points.begin(), frame.points.end());
  RectifyPoints(rectifier, &points);
  detection = Ok();
  detected.clear();
  release = frame.release;
  release_user = frame.release_user;
  if (release != nullptr) {
    image = frame.image;
  } else {
    CopyImage(frame.image, &pixels, &image);
  }
}

void FrameSlot::ReleaseImage() {
  if (auto* callback = std::exchange(release, nullptr)) callback(release_user);
}

Status ValidateFrame(const SessionFrame& frame) {
  if (const Status valid = frame.image.Validate(); !valid) return valid;
  const Camera& camera = frame.camera.pinhole;
  if (!camera.IsValid()) return Invalid("camera is not a finite pinhole camera");
  if (camera.width_px != frame.image.width_px || camera.height_px != frame.image.height_px) {
    return Invalid("camera is for " + std::to_string(camera.width_px) + " x " +
                   std::to_string(camera.height_px) + " px, the image has " +
                   std::to_string(frame.image.width_px) + " x " +
                   std::to_string(frame.image.height_px));
  }
  if (const Status valid = ValidatePrior(frame.prior, "prior"); !valid) return valid;
  if (frame.more_priors.size() > kMaxMorePriors) {
    return Invalid("more_priors has " + std::to_string(frame.more_priors.size()) +
                   " entries, more than " + std::to_string(kMaxMorePriors));
  }
  for (size_t i = 0; i < frame.more_priors.size(); ++i) {
    const std::string name = "more_priors[" + std::to_string(i) + "]";
    if (const Status valid = ValidatePrior(frame.more_priors[i], name); !valid) return valid;
  }
  for (size_t i = 0; i < frame.points.size(); ++i) {
    const PointMatch& point = frame.points[i];
    if (!point.pixel.allFinite() || !point.point_in_world.allFinite() ||
        !point.deviation_in_world.allFinite()) {
      return Invalid("points[" + std::to_string(i) + "] is not finite");
    }
  }
  return Ok();
}

}  // namespace plumb
