// Where the depth of a map's segments comes from.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace plumb {

enum class DepthSource : uint8_t {
  kSensor,  // depth images beside the colour images
  kViews,   // the key frames' segments themselves, triangulated with the known poses
};

/// "sensor" or "views", as manifests and the program's options say it.
constexpr std::string_view NameOf(DepthSource source) {
  return source == DepthSource::kSensor ? "sensor" : "views";
}

/// Inverse of NameOf().
constexpr std::optional<DepthSource> DepthSourceOf(std::string_view name) {
  for (const DepthSource source : {DepthSource::kSensor, DepthSource::kViews}) {
    if (name == NameOf(source)) return source;
  }
  return std::nullopt;
}

}  // namespace plumb
