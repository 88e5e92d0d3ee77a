// Colour, depth and true pose of a sequence's frames, checked before they are used.
#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "plumb/map/depth_view.h"
#include "tools/datasets/tum_sequence.h"
#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

/// Reads a sequence and the list of some of its frames; image, pose and, if wanted, depth image of
/// each must exist.
Outcome SelectPosedFrames(const std::string& sequence_directory, const std::string& list_path,
                          bool with_depth, TumSequence* out_sequence,
                          std::vector<SequenceFrame>* out_frames);

/// kExitBadData or kExitNoInput naming the first frame without a pose or an image file.
Outcome CheckPosed(const std::string& sequence_directory, const std::vector<SequenceFrame>& frames,
                   bool with_depth);

/// A colour image of the camera's size.
Outcome ReadFrameImage(const SequenceFrame& frame, const Camera& camera, cv::Mat* out_color);

/// A frame's images, of the camera's size.
struct RgbdImages {
  cv::Mat color;  // BGR
  cv::Mat depth;  // 16 bits
};
Outcome ReadRgbdImages(const SequenceFrame& frame, const Camera& camera, RgbdImages* out_images);

/// A borrowed view of 16-bit depth with `depth_scale` units per metre.
DepthView ViewOfDepth(const cv::Mat& depth, double depth_scale);

}  // namespace plumb::tools
