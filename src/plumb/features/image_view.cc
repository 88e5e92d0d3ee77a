#include "plumb/features/image_view.h"

#include <string>

namespace plumb {
namespace {

constexpr int kMaxSide = 16384;

bool HasSubsampledChroma(PixelFormat format) {
  return format == PixelFormat::kNv12 || format == PixelFormat::kNv21 ||
         format == PixelFormat::kI420;
}

}  // namespace

int NumPlanes(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGray8:
    case PixelFormat::kRgb8:
    case PixelFormat::kBgr8:
      return 1;
    case PixelFormat::kNv12:
    case PixelFormat::kNv21:
      return 2;
    case PixelFormat::kI420:
      return 3;
  }
  return 0;
}

int64_t RowBytes(PixelFormat format, size_t plane, int width_px) {
  if (format == PixelFormat::kRgb8 || format == PixelFormat::kBgr8) return int64_t{3} * width_px;
  if (format == PixelFormat::kI420 && plane > 0) return width_px / 2;
  return width_px;  // Luminance, or interleaved chroma: two bytes for every second pixel.
}

int NumRows(PixelFormat format, size_t plane, int height_px) {
  return HasSubsampledChroma(format) && plane > 0 ? height_px / 2 : height_px;
}

Status ImageView::Validate() const {
  const auto invalid = [](std::string message) -> Status {
    return Error{ErrorCode::kInvalidArgument, "ImageView: " + std::move(message)};
  };
  const size_t num_planes = static_cast<size_t>(NumPlanes(format));
  if (num_planes == 0) {
    return invalid("format " + std::to_string(static_cast<int>(format)) + " is unknown");
  }
  if (width_px < 1 || width_px > kMaxSide) {
    return invalid("width_px " + std::to_string(width_px) + " is outside 1..16384");
  }
  if (height_px < 1 || height_px > kMaxSide) {
    return invalid("height_px " + std::to_string(height_px) + " is outside 1..16384");
  }
  if (HasSubsampledChroma(format) && (width_px % 2 != 0 || height_px % 2 != 0)) {
    return invalid("subsampled chroma needs even sizes, not " + std::to_string(width_px) + " x " +
                   std::to_string(height_px));
  }
  for (size_t i = 0; i < num_planes; ++i) {
    const Plane& plane = planes[i];
    if (plane.data == nullptr) return invalid("planes[" + std::to_string(i) + "].data is null");
    const int64_t row_bytes = RowBytes(format, i, width_px);
    if (plane.row_stride_bytes < row_bytes) {
      return invalid("planes[" + std::to_string(i) + "].row_stride_bytes " +
                     std::to_string(plane.row_stride_bytes) + " is less than a row of " +
                     std::to_string(row_bytes) + " bytes");
    }
  }
  return Ok();
}

}  // namespace plumb
