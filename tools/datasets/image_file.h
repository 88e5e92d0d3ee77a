// Image and depth files, decoded by OpenCV.
#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

#include "plumb/base/result.h"
#include "plumb/features/image_view.h"

namespace plumb::tools {

/// A colour image as 8-bit BGR. The orientation that cameras note in the file is ignored, since the
/// intrinsics hold for the sensor's rows and columns.
/// @return kNotFound; kCorruptData if the file is no image that can be decoded.
Result<cv::Mat> ReadColorImage(const std::string& path);

/// A depth image as 16-bit integers.
/// @return kNotFound; kCorruptData if the file is no single-channel 16-bit image.
Result<cv::Mat> ReadDepthImage(const std::string& path);

/// View of an 8-bit BGR or grey image; `image` must outlive it.
ImageView ViewOf(const cv::Mat& image);

}  // namespace plumb::tools
