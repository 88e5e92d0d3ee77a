// A map on disk: a directory with a manifest and checksummed tiles of fixed little-endian records.
#pragma once

#include <string>
#include <string_view>

#include "plumb/base/result.h"
#include "plumb/map/line_map.h"

namespace plumb {

/// The file that every map holds.
inline constexpr const char* kMapManifestName = "manifest.json";

/// Whether a map may hold `name`, relative to its directory; folders end in a slash.
bool IsMapFile(std::string_view name);

struct WriteMapOptions {
  /// Replace an existing map. Only a directory that holds nothing but a map, or nothing, is
  /// replaced.
  bool overwrite = false;
};

/// Writes `map` to the new directory `directory`, whose parent must exist. The files are written to
/// a temporary directory beside it, flushed to the disk and renamed, so that `directory` holds the
/// old map, the new one or nothing, never a part. Equal maps give equal bytes. Coordinates are
/// rounded to float32 relative to the first key frame's centre (rounded to whole metres); poses and
/// intrinsics keep their doubles.
/// @return kInvalidArgument when the map is inconsistent (CheckMap), the target exists or cannot be
///         replaced; kNotFound when the parent does not exist; kUnsupported when the system refuses
///         to write. Nothing is left behind then.
/// Source: docs/adr/0003-map-is-plain-data.md.
Status WriteMap(const LineMap& map, const std::string& directory,
                const WriteMapOptions& options = {});

/// Reads a map that WriteMap() wrote. Trusts nothing: sizes are checked before memory is allocated,
/// checksums before records are parsed, numbers and references (CheckMap) before the map is
/// returned. Links inside the directory are not followed.
/// @return kNotFound when there is no map; kUnsupported for another version of the format;
///         kCorruptData naming the file for everything else.
Result<LineMap> ReadMap(const std::string& directory);

}  // namespace plumb
