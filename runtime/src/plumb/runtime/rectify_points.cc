#include "plumb/runtime/rectify_points.h"

#include <cstddef>

namespace plumb {

void RectifyPoints(const Rectifier& rectifier, std::vector<PointMatch>* points) {
  if (rectifier.IsIdentity()) return;
  std::erase_if(*points, [&rectifier](PointMatch& point) {
    const auto ideal = rectifier.ToIdeal(point.pixel);
    if (ideal) point.pixel = *ideal;
    return !ideal;
  });
}

}  // namespace plumb
