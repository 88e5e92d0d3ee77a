#include "plumb/runtime/frame_slot.h"

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
  release = {frame.release, frame.release_user};
  if (release.callback != nullptr) {
    image = frame.image;
  } else {
    CopyImage(frame.image, &pixels, &image);
  }
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
  for (const Status& valid :
       {CheckPriors(frame.prior, frame.more_priors), CheckPoints(frame.points)}) {
    if (!valid) return Invalid(valid.error().message);
  }
  return Ok();
}

}  // namespace plumb
