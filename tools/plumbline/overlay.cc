// Pictures of what a frame's refinement saw: detected, matched and rejected segments, the map's
// lines.
#include "tools/plumbline/overlay.h"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "plumb/geometry/line_projection.h"

namespace plumb::tools {
namespace {

constexpr double kScale = 2.0;
constexpr double kPiecePx = 8.0;  // of a curve, drawn straight
constexpr int kSubpixelBits = 4;
constexpr int kCaptionHeight = 34;
const cv::Scalar kMapColor(255, 140, 40);  // blue, green, red
const cv::Scalar kMatchedColor(60, 230, 60);
const cv::Scalar kRejectedColor(60, 60, 240);

cv::Point Fixed(const Eigen::Vector2d& px) {
  // Pixel centres stay pixel centres: the middle of pixel 0 is at (scale - 1) / 2.
  const Eigen::Vector2d scaled = (px.array() + 0.5) * kScale - 0.5;
  constexpr double kOne = 1 << kSubpixelBits;
  return {static_cast<int>(std::lround(scaled.x() * kOne)),
          static_cast<int>(std::lround(scaled.y() * kOne))};
}

/// Draws segments of the ideal image where the image shows them.
class SegmentPainter {
 public:
  SegmentPainter(const Rectifier& rectifier, cv::Mat* canvas)
      : rectifier_(rectifier), canvas_(canvas) {}

  void Draw(const Segment2& segment, const cv::Scalar& color, int thickness) const {
    const int pieces =
        rectifier_.IsIdentity() ? 1 : 1 + static_cast<int>(segment.Length() / kPiecePx);
    std::optional<ImagePoint> last = rectifier_.ToImage(segment.start);
    for (int i = 1; i <= pieces; ++i) {
      const double u = static_cast<double>(i) / pieces;
      const std::optional<ImagePoint> next =
          rectifier_.ToImage((1.0 - u) * segment.start + u * segment.end);
      if (last && next) {
        cv::line(*canvas_, Fixed(last->px), Fixed(next->px), color, thickness, cv::LINE_AA,
                 kSubpixelBits);
      }
      last = next;
    }
  }

 private:
  const Rectifier& rectifier_;
  cv::Mat* canvas_;
};

void DrawCaption(const FrameResult& result, size_t num_map_lines, cv::Mat* canvas) {
  cv::rectangle(*canvas, cv::Rect(0, 0, canvas->cols, kCaptionHeight), cv::Scalar(25, 25, 25),
                cv::FILLED);
  const auto write = [&](const char* format, size_t count, int x, const cv::Scalar& color) {
    char text[64];
    std::snprintf(text, sizeof(text), format, count);
    cv::putText(*canvas, text, {x, 23}, cv::FONT_HERSHEY_SIMPLEX, 0.6, color, 1, cv::LINE_AA);
  };
  const size_t num_matched = result.refined.matches.size();
  cv::putText(*canvas, std::string(ToString(result.refined.status)), {12, 23},
              cv::FONT_HERSHEY_SIMPLEX, 0.6, cv::Scalar(255, 255, 255), 1, cv::LINE_AA);
  write("matches %zu", num_matched, 190, kMatchedColor);
  write("segments %zu, red: unmatched", result.segments.size(), 350, kRejectedColor);
  write("map lines %zu", num_map_lines, 680, kMapColor);
}

}  // namespace

cv::Mat DrawOverlay(const cv::Mat& image, double brightness, const Rectifier& rectifier,
                    const MapIndex& index, const FrameResult& result) {
  cv::Mat canvas;
  cv::resize(image, canvas, {}, kScale, kScale, cv::INTER_LINEAR);
  canvas.convertTo(canvas, -1, brightness);

  std::vector<uint32_t> visible;
  const SegmentPainter painter(rectifier, &canvas);
  index.VisibleLines(rectifier.ideal(), result.refined.cam_from_world, VisibilityOptions{},
                     &visible);
  for (const uint32_t line : visible) {
    const std::optional<Segment2> projected = ProjectSegment(
        rectifier.ideal(), result.refined.cam_from_world, index.map().lines[line].segment_in_world);
    if (projected) painter.Draw(*projected, kMapColor, 3);
  }
  std::vector<bool> matched(result.segments.size(), false);
  for (const LineMatch& match : result.refined.matches) matched[match.segment] = true;
  for (size_t i = 0; i < result.segments.size(); ++i) {
    if (!matched[i]) painter.Draw(result.segments[i], kRejectedColor, 1);
  }
  for (size_t i = 0; i < result.segments.size(); ++i) {
    if (matched[i]) painter.Draw(result.segments[i], kMatchedColor, 2);
  }
  DrawCaption(result, visible.size(), &canvas);
  return canvas;
}

}  // namespace plumb::tools
