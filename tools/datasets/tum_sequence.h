// Posed RGB-D sequences in the TUM layout: rgb.txt, depth.txt, groundtruth.txt, camera.json.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/rigid3.h"

namespace plumb::tools {

/// Depth is taken for an image at most so far away in time, as TUM's own tools do.
inline constexpr int64_t kMaxDepthDelayNs = 20'000'000;

/// One colour image and what goes with it.
struct SequenceFrame {
  int64_t timestamp_ns = 0;
  std::string color_path;
  std::optional<std::string> depth_path;  // nearest in time within kMaxDepthDelayNs
  std::optional<Rigid3> cam_from_world;   // ground truth at the image's time
};

struct TumSequence {
  std::string directory;
  Rectifier rectifier;                // of the images' camera and lens
  Camera camera;                      // the ideal one behind it: rectifier.ideal()
  double depth_scale = 0.0;           // depth image units per metre
  std::vector<SequenceFrame> frames;  // ascending in time, every timestamp once
};

/// Reads the sequence's text files; images stay unread. depth.txt and groundtruth.txt may be
/// absent. camera.json: camera_file.h ("depth_scale" is needed only with depth).
/// @return kNotFound for a missing directory, rgb.txt or camera.json; kCorruptData naming file,
/// line
///         or member and value; kUnsupported for another camera model.
Result<TumSequence> ReadTumSequence(const std::string& directory);

/// The frames named by a list of timestamps, in the list's order; a timestamp names the frame that
/// is at most 1 ms away.
/// @return kNotFound; kCorruptData naming the line if a timestamp names no frame or a frame twice,
/// or
///         if the list is empty.
Result<std::vector<SequenceFrame>> SelectFrames(const TumSequence& sequence,
                                                const std::string& list_path);

/// Checks that the files of every frame exist before long work starts.
/// @return kNotFound naming the first missing file, or the frame that has no depth if it is wanted.
Status CheckFilesExist(const std::vector<SequenceFrame>& frames, bool with_depth);

}  // namespace plumb::tools
