// What is minimised between a segment and the 3D line that it was matched with.
#pragma once

namespace plumb {

enum class LineResidual {
  kPerpendicular,  // distances of the segment's ends to the projected infinite line
  kMidpointAngle,  // PtLine eq. 6 and 7
};

}  // namespace plumb
