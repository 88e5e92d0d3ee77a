// The middle of some numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace plumb {

/// The upper one of two in the middle; 0 of none. Reorders `values`, which hold no NaN.
inline double Median(std::span<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace plumb
