// Where the depth of a map's segments comes from.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace plumb {

enum class DepthSource : uint8_t {
  kSensor,  // depth images beside the colour images, as they are
  kViews,   // the key frames' segments themselves, triangulated with the known poses
  kBoth,    // depth images, corrected by and averaged with what the views say
};

/// "sensor", "views" or "both", as manifests and the program's options say it.
constexpr std::string_view NameOf(DepthSource source) {
  switch (source) {
    case DepthSource::kSensor:
      return "sensor";
    case DepthSource::kViews:
      return "views";
    case DepthSource::kBoth:
      return "both";
  }
  return "";
}

/// Inverse of NameOf().
constexpr std::optional<DepthSource> DepthSourceOf(std::string_view name) {
  for (const DepthSource source : {DepthSource::kSensor, DepthSource::kViews, DepthSource::kBoth}) {
    if (name == NameOf(source)) return source;
  }
  return std::nullopt;
}

}  // namespace plumb
