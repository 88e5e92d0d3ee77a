// Names that travel in files: of networks and detectors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace plumb {

inline constexpr size_t kMaxPlainNameBytes = 63;

/// Letters, digits, '_' and '-', at most kMaxPlainNameBytes of them: no path, no line end, nothing
/// that a terminal obeys. Files of strangers hold such names.
inline bool IsPlainName(std::string_view name) {
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  };
  return name.size() <= kMaxPlainNameBytes && std::all_of(name.begin(), name.end(), is_plain);
}

}  // namespace plumb
