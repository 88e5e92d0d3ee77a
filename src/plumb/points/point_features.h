// SIFT points of one image: where they are and what they look like.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "plumb/base/result.h"

namespace plumb {

/// Borrowed 8-bit image; the data must outlive the call that takes the view.
struct GrayImage {
  const uint8_t* data = nullptr;
  int64_t row_stride_bytes = 0;
  int width_px = 0, height_px = 0;
};

/// SIFT, scaled to bytes as OpenCV does.
using PointDescriptor = std::array<uint8_t, 128>;

/// Parallel arrays. A place with several orientations appears once for each.
struct ImagePoints {
  std::vector<Eigen::Vector2f> pixels;
  std::vector<PointDescriptor> descriptors;

  size_t size() const { return pixels.size(); }
};

struct PointFeatureOptions {
  int max_count = 1500;  // strongest kept
};

/// Owns the work space; not thread-safe.
class PointExtractor {
 public:
  explicit PointExtractor(const PointFeatureOptions& options = {});
  ~PointExtractor();
  PointExtractor(PointExtractor&&) noexcept;
  PointExtractor& operator=(PointExtractor&&) noexcept;

  /// Deterministic: the order is the detector's, by place.
  /// @return kInvalidArgument when the image is smaller than 16 x 16 or its rows overlap.
  /// Source: Lowe, IJCV 2004, as OpenCV implements it.
  Status Extract(const GrayImage& image, ImagePoints* out_points);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
