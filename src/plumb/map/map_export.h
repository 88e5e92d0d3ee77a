// A map's lines for other programs: PLY and OBJ.
#pragma once

#include <string>

#include "plumb/base/result.h"
#include "plumb/map/line_map.h"

namespace plumb {

enum class MapExportFormat {
  kPly,  // binary, little endian: vertices (x, y, z double), edges (vertex1, vertex2, observing,
         // sigma_m: root of the larger trace of the two end points' covariances)
  kObj,  // text: "v x y z" and "l a b", indices from 1
};

struct MapExportOptions {
  MapExportFormat format = MapExportFormat::kPly;
  uint32_t min_observing = 0;  // lines that fewer key frames observed are left out
};

/// Writes the fused lines, in the map's order, in world coordinates [m], two vertices a line. The
/// file appears complete or not at all; an existing one is replaced, a device or pipe written to.
/// @return kNotFound when the directory does not exist, kIoError when the system refuses.
Status ExportLines(const LineMap& map, const std::string& path,
                   const MapExportOptions& options = {});

}  // namespace plumb
