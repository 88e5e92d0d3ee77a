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
/// ..]; the images lie in DIR/images.
/// @return kNotFound; kCorruptData naming the entry and member.
Result<std::vector<AnnotatedImage>> ReadLineAnnotations(const std::string& directory,
                                                        const std::string& image_folder = "images");

}  // namespace plumb::tools
