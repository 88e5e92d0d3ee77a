// Pixels of a straight line.
#include "tools/metrics/line_raster.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>

namespace plumb::tools {
namespace {

int64_t FloorDivide(int64_t a, int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }  // b > 0

int64_t Rounded(double value) { return static_cast<int64_t>(std::floor(value + 0.5)); }

}  // namespace

void RasterizeLine(const Segment2& segment, int width_px, int height_px,
                   std::vector<Eigen::Vector2i>* out_pixels) {
  out_pixels->clear();
  const int64_t x0 = Rounded(segment.start.x()), y0 = Rounded(segment.start.y());
  const int64_t dx = Rounded(segment.end.x()) - x0, dy = Rounded(segment.end.y()) - y0;
  const int64_t steps = std::max(std::abs(dx), std::abs(dy));
  // start + d * i / steps, rounded without a floating-point tie.
  const auto at = [&](int64_t start, int64_t d, int64_t i) {
    return steps == 0 ? start : start + FloorDivide(2 * i * d + steps, 2 * steps);
  };
  for (int64_t i = 0; i <= steps; ++i) {
    const int64_t x = at(x0, dx, i), y = at(y0, dy, i);
    if (x >= 0 && y >= 0 && x < width_px && y < height_px) {
      out_pixels->emplace_back(static_cast<int>(x), static_cast<int>(y));
    }
  }
}

}  // namespace plumb::tools
