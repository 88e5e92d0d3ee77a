// How deep a JSON text is nested, found before it is parsed.
#pragma once

#include <string_view>

namespace plumb {

/// More than any JSON file of this project has.
inline constexpr int kMaxJsonDepth = 8;

/// Whether `text` opens at most `max_depth` objects and arrays at a time. Parsers, and what copies
/// or prints their values, may recurse once a level: a deeper text could exhaust the stack.
bool IsShallowJson(std::string_view text, int max_depth = kMaxJsonDepth);

}  // namespace plumb
