// Moves detected segments on to the image's edges: ridge, trim, ridge, other borders in, duplicates
// out.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/features/image_view.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/segment.h"

namespace plumb {

struct SegmentRefinerOptions {
  double min_score = 0.0;         // segments below are dropped first ...
  uint32_t min_count = 60;        // ... but never below so many of the best
  uint32_t max_count = 400;       // best by score; 1..4096
  double min_length_px = 12.0;    // in the image; shorter ones are dropped, before and after
  bool trim = true;               // cut each segment to where its edge is
  bool add_other_borders = true;  // of bars and thin lines, with the score of the one detected
  bool remove_duplicates = true;
};

/// The step that every detector shares (docs/method/association.md). Owns its work space.
/// Not thread-safe.
class SegmentRefiner {
 public:
  explicit SegmentRefiner(const SegmentRefinerOptions& options);
  ~SegmentRefiner();

  /// @param image     The image that `segments` were found in; only its luminance is used.
  /// @param segments  [px], best score first.
  /// @return refined segments, best score first, at most two for each of `max_count`; none for an
  ///         invalid image.
  std::vector<Segment2> Refine(const ImageView& image, std::span<const Segment2> segments,
                               const Rectifier* rectifier = nullptr);

  /// The same into `out_segments`, without allocation once its capacity and the work space suffice.
  /// @param rectifier  Of an image with a lens: `segments` are of the image as ever, but
  ///                   `out_segments` are straight segments of the ideal image, whose curves were
  ///                   moved on to the image's edges. Null or identity: no lens.
  void Refine(const ImageView& image, std::span<const Segment2> segments,
              std::vector<Segment2>* out_segments, const Rectifier* rectifier = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
