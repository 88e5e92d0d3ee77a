// Image and depth files, decoded by OpenCV.
#include "tools/datasets/image_file.h"

#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "tools/datasets/text_file.h"

namespace plumb::tools {
namespace {

Result<cv::Mat> Decode(const std::string& path, int flags) {
  const Result<std::string> bytes = ReadFile(path);
  if (!bytes) return bytes.error();
  cv::Mat image;
  if (!bytes->empty()) {
    try {
      // OpenCV has no const view, but imdecode() only reads.
      const cv::Mat buffer(1, static_cast<int>(bytes->size()), CV_8UC1,
                           const_cast<char*>(bytes->data()));
      image = cv::imdecode(buffer, flags);
    } catch (const cv::Exception&) {
      image.release();
    }
  }
  if (image.empty()) {
    return Error{ErrorCode::kCorruptData, path + ": is no image that can be decoded"};
  }
  return image;
}

}  // namespace

Result<cv::Mat> ReadColorImage(const std::string& path) {
  return Decode(path, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
}

Result<cv::Mat> ReadDepthImage(const std::string& path) {
  Result<cv::Mat> image = Decode(path, cv::IMREAD_UNCHANGED);
  if (image && image->type() != CV_16UC1) {
    return Error{ErrorCode::kCorruptData, path + ": is no single-channel 16-bit depth image"};
  }
  return image;
}

ImageView ViewOf(const cv::Mat& image) {
  ImageView view;
  view.format = image.channels() == 1 ? PixelFormat::kGray8 : PixelFormat::kBgr8;
  view.width_px = image.cols;
  view.height_px = image.rows;
  view.planes[0] = {image.data, static_cast<int64_t>(image.step[0])};
  return view;
}

}  // namespace plumb::tools
