// Annotated line segments of benchmark images: images/ and annotations.json.
#pragma once

#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/geometry/segment.h"

namespace plumb::tools {

struct AnnotatedImage {
  std::string path;
  int width_px = 0, height_px = 0;
  std::vector<Segment2> lines;  // [px]
};

/// Reads DIR/annotations.json: [{"filename", "width", "height", "lines": [[x1, y1, x2, y2], ..]},
/// ..]; the images lie in DIR/images. Coordinates within +-2^20 px.
/// @return kNotFound; kCorruptData naming the entry and member.
Result<std::vector<AnnotatedImage>> ReadLineAnnotations(const std::string& directory,
                                                        const std::string& image_folder = "images");

/// Reads detections as `plumbline detect --json` writes them, [{"file", "lines": [[x1, y1, x2, y2],
/// ..], "scores": [..]}, ..], for `images`, which are found by their file name without folders.
/// @return the segments of each image in its order; kNotFound; kCorruptData naming the entry and
///         member, or the image without an entry.
Result<std::vector<std::vector<Segment2>>> ReadDetections(
    const std::string& path, const std::vector<AnnotatedImage>& images);

}  // namespace plumb::tools
