// What every 2D line detector offers to the frame loop and to the map builder.
#pragma once

#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/features/image_view.h"
#include "plumb/geometry/segment.h"

namespace plumb {

struct ImageSize {
  int width_px = 0, height_px = 0;
};

/// A detector finds raw segments; RefineSegments (segment_refiner.h) then moves them on to the
/// image's edges, the same way for every detector.
///
/// Submit() starts the work on one image and Collect() waits for it, so that a caller can do other
/// work in between; at most one image is in flight. Not thread-safe.
class LineDetector {
 public:
  virtual ~LineDetector() = default;

  /// Copies what it needs from `image` before it returns.
  /// @return kInvalidArgument for a bad image or when an image is in flight already; kDeviceLost.
  virtual Status Submit(const ImageView& image) = 0;

  /// Segments of the submitted image [px of that image], best score first.
  virtual Result<std::vector<Segment2>> Collect() = 0;

  /// True when Submit() only starts the work and another device does it until Collect(): then it
  /// pays to submit the next image before the segments of this one are used.
  virtual bool WorksInBackground() const { return false; }

  /// Name for reports: "lsd", "nano", ...
  virtual std::string Name() const = 0;

  /// What it runs on, for reports.
  virtual std::string DeviceName() const { return "cpu"; }

  /// The size that every image is scaled to; 0 x 0 where images are taken as they are.
  virtual ImageSize InputSize() const { return {}; }

  /// Submit() and Collect() in one call.
  Result<std::vector<Segment2>> Detect(const ImageView& image) {
    if (const Status submitted = Submit(image); !submitted) return submitted.error();
    return Collect();
  }
};

}  // namespace plumb
