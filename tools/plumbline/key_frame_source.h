// Where map build takes its key frames from: a sequence in TUM layout or a COLMAP model.
#pragma once

#include <string>
#include <vector>

#include "plumb/geometry/rectifier.h"
#include "tools/datasets/tum_sequence.h"
#include "tools/plumbline/exit_code.h"

namespace plumb::tools {

struct KeyFrameSource {
  std::vector<Rectifier> rectifiers;  // one a camera
  std::vector<SequenceFrame> frames;  // with poses, in the order of the map
  std::vector<size_t> rectifier_of;   // of each frame
  double depth_scale = 0.0;           // depth image units per metre
};

/// The frames of a sequence that a list names; their files exist.
Outcome OpenTumKeyFrames(const std::string& sequence, const std::string& list, bool with_depth,
                         KeyFrameSource* out);

/// All images of a COLMAP model, by name; their files exist. A frame's time is its image's id in
/// seconds.
Outcome OpenColmapKeyFrames(const std::string& model, const std::string& images,
                            KeyFrameSource* out);

}  // namespace plumb::tools
