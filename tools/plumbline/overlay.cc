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

void Draw(const Segment2& segment, const cv::Scalar& color, int thickness, cv::Mat* canvas) {
  cv::line(*canvas, Fixed(segment.start), Fixed(segment.end), color, thickness, cv::LINE_AA,
           kSubpixelBits);
}

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

cv::Mat DrawOverlay(const cv::Mat& image, double brightness, const Camera& camera,
                    const MapIndex& index, const FrameResult& result) {
  cv::Mat canvas;
  cv::resize(image, canvas, {}, kScale, kScale, cv::INTER_LINEAR);
  canvas.convertTo(canvas, -1, brightness);

  std::vector<uint32_t> visible;
  index.VisibleLines(camera, result.refined.cam_from_world, VisibilityOptions{}, &visible);
  for (const uint32_t line : visible) {
    const std::optional<Segment2> projected = ProjectSegment(
        camera, result.refined.cam_from_world, index.map().lines[line].segment_in_world);
    if (projected) Draw(*projected, kMapColor, 3, &canvas);
  }
  std::vector<bool> matched(result.segments.size(), false);
  for (const LineMatch& match : result.refined.matches) matched[match.segment] = true;
  for (size_t i = 0; i < result.segments.size(); ++i) {
    if (!matched[i]) Draw(result.segments[i], kRejectedColor, 1, &canvas);
  }
  for (size_t i = 0; i < result.segments.size(); ++i) {
    if (matched[i]) Draw(result.segments[i], kMatchedColor, 2, &canvas);
  }
  DrawCaption(result, visible.size(), &canvas);
  return canvas;
}

}  // namespace plumb::tools
