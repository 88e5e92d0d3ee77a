// Borrowed view of a camera image in the formats that cameras deliver.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "plumb/base/result.h"

namespace plumb {

/// Chroma of kNv12 (U, V), kNv21 (V, U) and kI420 (planes Y, U, V) is subsampled 2 x 2; width and
/// height must then be even.
enum class PixelFormat { kGray8, kRgb8, kBgr8, kNv12, kNv21, kI420 };

/// Layout of an image: how many planes, and how many bytes and rows each of them has. `plane` is
/// below NumPlanes(); sizes are of the whole image [px]. NumPlanes is 0 for an unknown format.
int NumPlanes(PixelFormat format);
int64_t RowBytes(PixelFormat format, size_t plane, int width_px);
int NumRows(PixelFormat format, size_t plane, int height_px);

/// Borrowed: the planes must outlive every call that takes the view.
struct ImageView {
  struct Plane {
    const uint8_t* data = nullptr;
    int64_t row_stride_bytes = 0;  // >= bytes of one row of this plane
  };

  PixelFormat format = PixelFormat::kGray8;
  int width_px = 0, height_px = 0;
  std::array<Plane, 3> planes;

  /// kInvalidArgument that names the first member out of range: size 1..16384, non-null planes,
  /// strides that hold a row, even sizes for subsampled chroma.
  Status Validate() const;
};

}  // namespace plumb
