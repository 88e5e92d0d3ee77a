// Weighted rows of a Jacobian, summed into normal equations several at a time.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "plumb/refine/normal_equations.h"

namespace plumb {

/// One entry a scalar residual, in single precision: a row's rounding is far below its noise.
struct ResidualRows {
  std::array<std::vector<float>, 6> jacobian;
  std::vector<float> residual, weight;  // rows of weight 0 count for nothing

  size_t size() const { return weight.size(); }
  void Resize(size_t count);
};

/// J^T W J and J^T W r of the rows.
NormalEquations SumRows(const ResidualRows& rows);

}  // namespace plumb
