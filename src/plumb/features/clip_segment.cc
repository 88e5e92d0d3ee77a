#include "plumb/features/clip_segment.h"

#include <algorithm>

namespace plumb {

bool ClipToImage(int width_px, int height_px, Segment2* segment) {
  const Eigen::Vector2d start = segment->start, delta = segment->Delta();
  if (!start.allFinite() || !delta.allFinite() || delta.isZero(0.0)) return false;
  const Eigen::Vector2d low(-0.5, -0.5), high(width_px - 0.5, height_px - 0.5);
  double from = 0.0, to = 1.0;  // The part that is left, as fractions of the segment.
  for (int axis = 0; axis < 2; ++axis) {
    if (delta[axis] == 0.0) {
      if (start[axis] < low[axis] || start[axis] > high[axis]) return false;
      continue;
    }
    const double a = (low[axis] - start[axis]) / delta[axis];
    const double b = (high[axis] - start[axis]) / delta[axis];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  if (!(from < to)) return false;
  segment->start = start + from * delta;
  segment->end = start + to * delta;
  return true;
}

}  // namespace plumb
