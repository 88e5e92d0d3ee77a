// Timestamps as data sets write them: decimal seconds, exact to the nanosecond.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <span>
#include <string>
#include <string_view>

#include "plumb/base/result.h"

namespace plumb::tools {

/// "1305031102.175304" -> 1305031102175304000 ns, digit by digit: a double would be off by 100 ns.
/// @return kCorruptData naming the text if it is no plain decimal number, if nanoseconds would be
///         lost or if it is beyond +-9e9 s, which leaves room in 64 bits for what is added to it.
Result<int64_t> ParseTimestamp(std::string_view seconds);

/// Inverse of ParseTimestamp: six decimals, nine if the nanoseconds need them.
std::string FormatTimestamp(int64_t timestamp_ns);

/// Of items that ascend in time, the one nearest to `timestamp_ns` within the tolerance, the
/// earlier one at a tie; nullptr if there is none.
template <typename Item>
const Item* NearestInTime(std::span<const Item> items, int64_t timestamp_ns, int64_t tolerance_ns) {
  const auto after =
      std::lower_bound(items.begin(), items.end(), timestamp_ns,
                       [](const Item& item, int64_t value) { return item.timestamp_ns < value; });
  const Item* nearest = nullptr;
  int64_t best_ns = tolerance_ns;
  // No difference of any two timestamps is taken: it need not fit.
  if (after != items.begin() && std::prev(after)->timestamp_ns >= timestamp_ns - best_ns) {
    nearest = &*std::prev(after);
    best_ns = timestamp_ns - nearest->timestamp_ns - 1;  // The later one must be strictly nearer.
  }
  if (after != items.end() && after->timestamp_ns <= timestamp_ns + best_ns) nearest = &*after;
  return nearest;
}

}  // namespace plumb::tools
