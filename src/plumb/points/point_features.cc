#include "plumb/points/point_features.h"

#include <cstring>
#include <opencv2/features2d.hpp>
#include <string>

namespace plumb {
namespace {

constexpr int kMinSide = 16, kMaxSide = 16384;

/// OpenCV doubles the image about the pixels' edges but halves the points about their centres
/// (unless told to upscale precisely, which only 4.8 and later know).
constexpr float kShiftPx = 0.25f;

}  // namespace

struct PointExtractor::Impl {
  cv::Ptr<cv::SIFT> sift;
  std::vector<cv::KeyPoint> key_points;
  cv::Mat descriptors;
};

PointExtractor::PointExtractor(const PointFeatureOptions& options)
    : impl_(std::make_unique<Impl>()) {
  // OpenCV's own defaults, but for the count and the type of the descriptors.
  impl_->sift = cv::SIFT::create(options.max_count, 3, 0.04, 10.0, 1.6, CV_8U);
}
PointExtractor::~PointExtractor() = default;
PointExtractor::PointExtractor(PointExtractor&&) noexcept = default;
PointExtractor& PointExtractor::operator=(PointExtractor&&) noexcept = default;

Status PointExtractor::Extract(const GrayImage& image, ImagePoints* out_points) {
  out_points->pixels.clear();
  out_points->descriptors.clear();
  const bool has_size = image.width_px >= kMinSide && image.height_px >= kMinSide &&
                        image.width_px <= kMaxSide && image.height_px <= kMaxSide;
  if (image.data == nullptr || !has_size || image.row_stride_bytes < image.width_px) {
    return Error{ErrorCode::kInvalidArgument,
                 "The image for point features has " + std::to_string(image.width_px) + " x " +
                     std::to_string(image.height_px) + " pixels and rows of " +
                     std::to_string(image.row_stride_bytes) + " bytes"};
  }
  // OpenCV does not write to it.
  const cv::Mat gray(image.height_px, image.width_px, CV_8U, const_cast<uint8_t*>(image.data),
                     static_cast<size_t>(image.row_stride_bytes));
  try {
    impl_->sift->detectAndCompute(gray, cv::noArray(), impl_->key_points, impl_->descriptors);
  } catch (const cv::Exception& exception) {
    return Error{ErrorCode::kInternal, "OpenCV's SIFT fails: " + std::string(exception.what())};
  }
  const size_t count = impl_->key_points.size();
  out_points->pixels.reserve(count);
  out_points->descriptors.resize(count);
  for (size_t i = 0; i < count; ++i) {
    out_points->pixels.emplace_back(impl_->key_points[i].pt.x - kShiftPx,
                                    impl_->key_points[i].pt.y - kShiftPx);
    std::memcpy(out_points->descriptors[i].data(), impl_->descriptors.ptr(static_cast<int>(i)),
                sizeof(PointDescriptor));
  }
  return Ok();
}

}  // namespace plumb
