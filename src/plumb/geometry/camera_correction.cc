#include "plumb/geometry/camera_correction.h"

#include <cmath>
#include <cstddef>

namespace plumb {
namespace {

constexpr double kSamePx = 0.01, kSameCoefficient = 1e-6;

}  // namespace

bool IsSameCamera(const ImageCamera& a, const ImageCamera& b) {
  const Camera &p = a.pinhole, &q = b.pinhole;
  if (p.width_px != q.width_px || p.height_px != q.height_px || a.lens.model != b.lens.model ||
      !(std::abs(p.fx - q.fx) <= kSamePx && std::abs(p.fy - q.fy) <= kSamePx &&
        std::abs(p.cx - q.cx) <= kSamePx && std::abs(p.cy - q.cy) <= kSamePx)) {
    return false;
  }
  for (size_t i = 0; i < a.lens.coefficients.size(); ++i) {
    if (!(std::abs(a.lens.coefficients[i] - b.lens.coefficients[i]) <= kSameCoefficient)) {
      return false;
    }
  }
  return true;
}

}  // namespace plumb
