#include "tools/plumbline/key_frame_source.h"

#include <cstdint>
#include <optional>
#include <utility>

#include "tools/datasets/colmap_model.h"
#include "tools/plumbline/posed_frames.h"

namespace plumb::tools {
namespace {

constexpr int64_t kSecondNs = 1'000'000'000;

}  // namespace

Outcome OpenTumKeyFrames(const std::string& sequence, const std::string& list, bool with_depth,
                         KeyFrameSource* out) {
  TumSequence opened;
  if (Outcome failed = SelectPosedFrames(sequence, list, with_depth, &opened, &out->frames)) {
    return failed;
  }
  out->rectifiers = {std::move(opened.rectifier)};
  out->rectifier_of.assign(out->frames.size(), 0);
  out->depth_scale = opened.depth_scale;
  return std::nullopt;
}

Outcome OpenColmapKeyFrames(const std::string& model, const std::string& images,
                            KeyFrameSource* out) {
  const Result<ColmapModel> read = ReadColmapModel(model);
  if (!read) return FailureFrom(read.error());
  for (const ColmapCamera& camera : read->cameras) {
    Result<Rectifier> rectifier = Rectifier::Create(camera.camera);
    if (!rectifier) {
      return Failure{kExitBadData, model + ": camera " + std::to_string(camera.id) + ": " +
                                       rectifier.error().message};
    }
    out->rectifiers.push_back(*std::move(rectifier));
  }
  for (const ColmapImage& image : read->images) {
    SequenceFrame frame;
    frame.timestamp_ns = image.id * kSecondNs;
    frame.color_path = images + "/" + image.name;
    frame.cam_from_world = image.cam_from_world;
    out->frames.push_back(std::move(frame));
    out->rectifier_of.push_back(image.camera);
  }
  const Status exist = CheckFilesExist(out->frames, false);
  return exist ? Outcome() : FailureFrom(exist.error());
}

}  // namespace plumb::tools
