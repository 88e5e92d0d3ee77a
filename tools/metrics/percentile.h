// Percentiles with linear interpolation between ranks, as numpy.percentile computes them.
#pragma once

#include <vector>

namespace plumb::tools {

/// @param values  Any order; taken by value since it is sorted.
/// @param percent  0 .. 100.
/// @return NaN for no values.
double Percentile(std::vector<double> values, double percent);

}  // namespace plumb::tools
