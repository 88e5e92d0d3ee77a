// Pictures of what a frame's refinement saw: detected, matched and rejected segments, the map's
// lines.
#pragma once

#include <opencv2/core/mat.hpp>

#include "plumb/geometry/rectifier.h"
#include "plumb/map/map_index.h"
#include "plumb/runtime/frame_result.h"

namespace plumb::tools {

/// The image, twice as large, with the map's lines that are visible from the refined pose (blue),
/// the matched segments (green), the segments without a match (red), and a caption.
/// What is straight without the lens is drawn as the curve that the image shows.
/// @param brightness  of the image behind the lines, 0..1; below 1, so that the lines stand out.
cv::Mat DrawOverlay(const cv::Mat& image, double brightness, const Rectifier& rectifier,
                    const MapIndex& index, const FrameResult& result);

}  // namespace plumb::tools
