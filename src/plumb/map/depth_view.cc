#include "plumb/map/depth_view.h"

#include <string>

namespace plumb {

Status DepthView::Validate() const {
  const auto invalid = [](const std::string& what) {
    return Error{ErrorCode::kInvalidArgument, "the depth image " + what};
  };
  if (data == nullptr) return invalid("has no data");
  if (width_px < 1 || height_px < 1 || width_px > 16384 || height_px > 16384) {
    return invalid("has a size of " + std::to_string(width_px) + " x " + std::to_string(height_px) +
                   " px, outside 1..16384");
  }
  const int64_t value_bytes = format == DepthFormat::kUint16 ? 2 : 4;
  if (row_stride_bytes < width_px * value_bytes) {
    return invalid("has a row stride of " + std::to_string(row_stride_bytes) +
                   " bytes, less than a row of " + std::to_string(width_px * value_bytes));
  }
  if (row_stride_bytes % value_bytes != 0 || reinterpret_cast<uintptr_t>(data) % value_bytes != 0) {
    return invalid("is not aligned to its " + std::to_string(value_bytes) + "-byte values");
  }
  if (!(std::isfinite(metres_per_unit) && metres_per_unit > 0.0)) {
    return invalid("has a scale of " + std::to_string(metres_per_unit) +
                   " metres per unit, which is not positive");
  }
  return Ok();
}

}  // namespace plumb
