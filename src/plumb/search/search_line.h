// A 3D line that the search may look for in the image.
#pragma once

#include "plumb/geometry/segment.h"

namespace plumb {

struct SearchLine {
  Segment3 segment_in_world;
  double weight = 1.0;  // how sure it is that the line is seen, > 0
};

}  // namespace plumb
