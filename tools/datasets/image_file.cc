// Image and depth files, decoded by OpenCV.
#include "tools/datasets/image_file.h"

#include <cstdint>
#include <string_view>

#include <opencv2/imgcodecs.hpp>

#include "tools/datasets/text_file.h"

namespace plumb::tools {
namespace {

/// Whether a JPEG's image is there to its end, which libjpeg only warns about: what is missing
/// comes out grey. What follows the image, as some cameras write it, is not looked at.
bool IsCompleteJpeg(std::string_view bytes) {
  constexpr char kMarker = '\xFF', kEnd = '\xD9', kScan = '\xDA';
  // What has no length behind it: stuffed bytes and restarts, both within scans, and 0x01.
  const auto is_restart = [](char code) { return code >= '\xD0' && code <= '\xD7'; };
  bool in_scan = false;
  for (size_t i = 2; i + 1 < bytes.size();) {
    const char code = bytes[i + 1];
    if (bytes[i] != kMarker || code == kMarker) {
      ++i;
    } else if (code == '\0' || code == '\x01' || is_restart(code)) {
      i += 2;
    } else if (code == kEnd) {
      return in_scan;
    } else {
      if (i + 3 >= bytes.size()) return false;
      in_scan = in_scan || code == kScan;
      i += 2 + 256 * static_cast<size_t>(static_cast<uint8_t>(bytes[i + 2])) +
           static_cast<uint8_t>(bytes[i + 3]);
    }
  }
  return false;
}

Result<cv::Mat> Decode(const std::string& path, int flags) {
  const Result<std::string> bytes = ReadFile(path);
  if (!bytes) return bytes.error();
  if (bytes->starts_with("\xFF\xD8") && !IsCompleteJpeg(*bytes)) {
    return Error{ErrorCode::kCorruptData, path + ": ends before its image is complete"};
  }
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
