// Timestamps as data sets write them: decimal seconds, exact to the nanosecond.
#pragma once

#include <cstdint>
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

}  // namespace plumb::tools
