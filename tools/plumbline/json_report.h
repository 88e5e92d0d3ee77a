// JSON documents that the program prints and writes.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// Keeps the order in which members were added.
using Json = nlohmann::ordered_json;

/// {"schema": "plumb.<kind>/1", "version": "x.y.z"} to which a command adds its members.
Json NewReport(const std::string& kind);

/// `value` rounded to `decimals`, so that documents stay readable; NaN becomes null in JSON.
double Rounded(double value, int decimals);

enum class JsonLayout {
  kIndented,  // for people, too
  kCompact,   // for long lists of numbers
};

/// The document as text. Of file names, what is not UTF-8 becomes a replacement character.
std::string ToJsonText(const Json& json, JsonLayout layout = JsonLayout::kIndented);

/// Prints the document alone on stdout.
Outcome PrintJson(const Json& json, JsonLayout layout = JsonLayout::kIndented);

/// Prints text for people on stdout.
Outcome PrintText(const std::string& text);

}  // namespace plumb::tools
