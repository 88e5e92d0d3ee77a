// The lines' part of the normal equations for many observations of few lines.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/refine/normal_equations.h"
#include "plumb/refine/row_sums.h"

namespace plumb {

/// Ends of lines in the camera [m], parallel arrays that someone else holds.
struct LineEnds {
  const float *start_x, *start_y, *start_z, *end_x, *end_y, *end_z;
};

/// As LineObservation, in parallel arrays.
struct LineObservationTable {
  std::vector<int32_t> line;          // index into LineEnds
  std::vector<float> x0, y0, x1, y1;  // the overlap's ends [px]
  std::vector<float> weight, variance_px2;

  size_t size() const { return line.size(); }
  void Resize(size_t count);
};

/// How the two ends of an observation share its Geman-McClure weight.
enum class LineLoss {
  kEachEnd,   // as AccumulateLines()
  kBothEnds,  // one weight by the sum of both squares, as SolveOverlapCost()
};

/// AccumulateLines() in single precision, eight observations at a time. Owns its work space and
/// does not allocate once warm; not thread-safe.
class LineAccumulator {
 public:
  LineEquations Accumulate(const Camera& camera, const LineEnds& ends,
                           const LineObservationTable& observations, double robust, LineLoss loss);

 private:
  ResidualRows rows_;
  std::vector<float> square_, variance_;
};

}  // namespace plumb
