// Percentiles with linear interpolation between ranks, as numpy.percentile computes them.
#include "tools/metrics/percentile.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace plumb::tools {

double Percentile(std::vector<double> values, double percent) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const double rank =
      std::clamp(percent / 100.0, 0.0, 1.0) * static_cast<double>(values.size() - 1);
  const auto low = static_cast<size_t>(rank);
  if (low + 1 == values.size()) return values.back();
  const double share = rank - static_cast<double>(low);
  return values[low] + share * (values[low + 1] - values[low]);
}

}  // namespace plumb::tools
