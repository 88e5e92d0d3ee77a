// A detector that looks at tiles of large images and returns only the segments asked for.
#pragma once

#include <memory>

#include "plumb/base/result.h"
#include "plumb/features/image_tiles.h"
#include "plumb/features/line_detector.h"
#include "plumb/features/segment_selection.h"

namespace plumb {

/// What a caller may ask of any detector beside its own thresholds.
struct DetectionOptions {
  SegmentSelection selection;
  TileGrid tiles;
};

/// `detector` itself if `options` ask for nothing, else a detector around it. Tiles of one image
/// have one size, so a network is recorded once for them; all but the last are done in Submit().
/// @return kInvalidArgument that names an option out of range.
Result<std::unique_ptr<LineDetector>> ConfigureDetector(std::unique_ptr<LineDetector> detector,
                                                        const DetectionOptions& options);

}  // namespace plumb
