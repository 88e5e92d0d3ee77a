#include "plumb/features/lsd_detector.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "plumb/features/luminance.h"

namespace plumb {
namespace {

// OpenCV shrinks the image by 0.8 without correcting for pixel centres: 0.5 / 0.8 - 0.5 px.
constexpr double kResizeShiftPx = 0.125;
constexpr double kMinLengthPx = 12.0;
constexpr double kHalfScoreLengthPx = 40.0;
// Below this LSD's own shrunk image has no room for a gradient.
constexpr int kMinSidePx = 8;

class LsdDetector : public LineDetector {
 public:
  Status Submit(const ImageView& image) override {
    if (in_flight_) {
      return Error{ErrorCode::kInvalidArgument, "LsdDetector: an image is in flight already"};
    }
    if (const Status valid = image.Validate(); !valid) return valid.error();
    segments_.clear();
    if (std::min(image.width_px, image.height_px) >= kMinSidePx) {
      // The one place where OpenCV's exceptions could enter.
      try {
        Detect(Luminance(image, &gray_));
      } catch (const cv::Exception& e) {
        return Error{e.code == cv::Error::StsNoMem ? ErrorCode::kOutOfMemory : ErrorCode::kInternal,
                     "LsdDetector: OpenCV failed: " + e.msg};
      }
    }
    in_flight_ = true;
    return Ok();
  }

  Result<std::vector<Segment2>> Collect() override {
    if (!in_flight_) {
      return Error{ErrorCode::kInvalidArgument, "LsdDetector: no image was submitted"};
    }
    in_flight_ = false;
    return std::move(segments_);
  }

  std::string Name() const override { return "lsd"; }

 private:
  void Detect(const GrayView& gray) {
    // OpenCV has no const view, but detect() only reads.
    const cv::Mat mat(gray.height_px, gray.width_px, CV_8UC1, const_cast<uint8_t*>(gray.data),
                      static_cast<size_t>(gray.row_stride_bytes));
    if (!lsd_) lsd_ = cv::createLineSegmentDetector(cv::LSD_REFINE_STD);
    lines_.clear();
    lsd_->detect(mat, lines_);
    for (const cv::Vec4f& line : lines_) {
      Segment2 segment;
      segment.start = Eigen::Vector2d(line[0], line[1]).array() + kResizeShiftPx;
      segment.end = Eigen::Vector2d(line[2], line[3]).array() + kResizeShiftPx;
      const double length = segment.Length();
      if (!(length > kMinLengthPx)) continue;  // Also drops NaN.
      segment.score = length / (length + kHalfScoreLengthPx);
      segments_.push_back(segment);
    }
    std::stable_sort(segments_.begin(), segments_.end(),
                     [](const Segment2& a, const Segment2& b) { return a.score > b.score; });
  }

  cv::Ptr<cv::LineSegmentDetector> lsd_;
  std::vector<uint8_t> gray_;
  std::vector<cv::Vec4f> lines_;
  std::vector<Segment2> segments_;
  bool in_flight_ = false;
};

}  // namespace

std::unique_ptr<LineDetector> CreateLsdDetector() { return std::make_unique<LsdDetector>(); }

}  // namespace plumb
