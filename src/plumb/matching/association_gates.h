// How far apart a projected line and a segment may be to be a pair.
#pragma once

namespace plumb {

struct AssociationGates {
  double sigma_px = 2.0;     // of the perpendicular distance; pairs beyond 3 sigma do not exist
  double sigma_sine = 0.05;  // of the sine of the angle, likewise
  double min_overlap_px = 8.0;
  double min_overlap_share = 0.3;  // of the shorter of the two
};

}  // namespace plumb
