// Colour, depth and true pose of a sequence's frames, checked before they are used.
#include "tools/plumbline/posed_frames.h"

#include <cstdint>
#include <utility>

#include "tools/datasets/image_file.h"
#include "tools/datasets/timestamp.h"

namespace plumb::tools {
namespace {

Outcome CheckSize(const std::string& path, const cv::Mat& image, const Camera& camera) {
  if (image.cols == camera.width_px && image.rows == camera.height_px) return std::nullopt;
  return Failure{kExitBadData, path + ": is " + std::to_string(image.cols) + " x " +
                                   std::to_string(image.rows) + ", its camera " +
                                   std::to_string(camera.width_px) + " x " +
                                   std::to_string(camera.height_px)};
}

}  // namespace

Outcome SelectPosedFrames(const std::string& sequence_directory, const std::string& list_path,
                          bool with_depth, TumSequence* out_sequence,
                          std::vector<SequenceFrame>* out_frames) {
  Result<TumSequence> sequence = ReadTumSequence(sequence_directory);
  if (!sequence) return FailureFrom(sequence.error());
  Result<std::vector<SequenceFrame>> frames = SelectFrames(*sequence, list_path);
  if (!frames) return FailureFrom(frames.error());
  if (Outcome failed = CheckPosed(sequence_directory, *frames, with_depth)) return failed;
  *out_sequence = *std::move(sequence);
  *out_frames = *std::move(frames);
  return std::nullopt;
}

Outcome CheckPosed(const std::string& sequence_directory, const std::vector<SequenceFrame>& frames,
                   bool with_depth) {
  for (const SequenceFrame& frame : frames) {
    if (!frame.cam_from_world) {
      return Failure{kExitBadData, sequence_directory + "/groundtruth.txt: no pose for frame " +
                                       FormatTimestamp(frame.timestamp_ns)};
    }
  }
  const Status exist = CheckFilesExist(frames, with_depth);
  return exist ? Outcome() : FailureFrom(exist.error());
}

Outcome ReadFrameImage(const SequenceFrame& frame, const Camera& camera, cv::Mat* out_color) {
  Result<cv::Mat> color = ReadColorImage(frame.color_path);
  if (!color) return FailureFrom(color.error());
  if (Outcome failed = CheckSize(frame.color_path, *color, camera)) return failed;
  *out_color = *std::move(color);
  return std::nullopt;
}

Outcome ReadRgbdImages(const SequenceFrame& frame, const Camera& camera, RgbdImages* out_images) {
  cv::Mat color;
  if (Outcome failed = ReadFrameImage(frame, camera, &color)) return failed;
  Result<cv::Mat> depth = ReadDepthImage(*frame.depth_path);
  if (!depth) return FailureFrom(depth.error());
  if (Outcome failed = CheckSize(*frame.depth_path, *depth, camera)) return failed;
  *out_images = {std::move(color), *std::move(depth)};
  return std::nullopt;
}

DepthView ViewOfDepth(const cv::Mat& depth, double depth_scale) {
  DepthView view;
  view.format = DepthFormat::kUint16;
  view.data = depth.data;
  view.row_stride_bytes = static_cast<int64_t>(depth.step[0]);
  view.width_px = depth.cols;
  view.height_px = depth.rows;
  view.metres_per_unit = 1.0 / depth_scale;
  return view;
}

}  // namespace plumb::tools
