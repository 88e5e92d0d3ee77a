// Posed RGB-D sequences in the TUM layout: rgb.txt, depth.txt, groundtruth.txt, camera.json.
#include "tools/datasets/tum_sequence.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

#include "tools/datasets/camera_file.h"
#include "tools/datasets/text_file.h"
#include "tools/datasets/timestamp.h"
#include "tools/datasets/trajectory.h"

namespace plumb::tools {
namespace {

constexpr int64_t kSameFrameNs = 1'000'000;

bool Exists(const std::string& path) {
  std::error_code code;
  return std::filesystem::exists(path, code);
}

struct StampedFile {
  int64_t timestamp_ns = 0;
  std::string path;
};

/// rgb.txt or depth.txt: "timestamp file", ascending afterwards.
Result<std::vector<StampedFile>> ReadFileList(const std::string& directory, const char* name) {
  const std::string path = directory + "/" + name;
  const Result<std::string> text = ReadFile(path);
  if (!text) return text.error();
  std::vector<StampedFile> files;
  for (const DataLine& line : DataLines(*text)) {
    const auto corrupt = [&](const std::string& message) {
      return Error{ErrorCode::kCorruptData, Place(path, line) + ": " + message};
    };
    if (line.fields.size() != 2) {
      return corrupt(std::to_string(line.fields.size()) + " fields, want 2: timestamp file");
    }
    const Result<int64_t> timestamp_ns = ParseTimestamp(line.fields[0]);
    if (!timestamp_ns) return corrupt(timestamp_ns.error().message);
    files.push_back({*timestamp_ns, directory + "/" + std::string(line.fields[1])});
  }
  std::stable_sort(files.begin(), files.end(), [](const StampedFile& a, const StampedFile& b) {
    return a.timestamp_ns < b.timestamp_ns;
  });
  for (size_t i = 1; i < files.size(); ++i) {
    if (files[i].timestamp_ns == files[i - 1].timestamp_ns) {
      return Error{
          ErrorCode::kCorruptData,
          path + ": timestamp " + FormatTimestamp(files[i].timestamp_ns) + " occurs twice"};
    }
  }
  return files;
}

/// Index of the item nearest in time within the tolerance, the earlier one at a tie.
template <typename Item>
std::optional<size_t> Nearest(const std::vector<Item>& items, int64_t timestamp_ns,
                              int64_t tolerance_ns) {
  const auto after =
      std::lower_bound(items.begin(), items.end(), timestamp_ns,
                       [](const Item& item, int64_t value) { return item.timestamp_ns < value; });
  std::optional<size_t> nearest;
  int64_t best_ns = tolerance_ns;
  // No difference of any two timestamps is taken: it need not fit.
  if (after != items.begin() && std::prev(after)->timestamp_ns >= timestamp_ns - best_ns) {
    nearest = static_cast<size_t>(std::prev(after) - items.begin());
    best_ns = timestamp_ns - std::prev(after)->timestamp_ns - 1;
  }
  if (after != items.end() && after->timestamp_ns <= timestamp_ns + best_ns) {
    nearest = static_cast<size_t>(after - items.begin());
  }
  return nearest;
}

Status ReadCamera(const std::string& path, bool with_depth, TumSequence* sequence) {
  const Result<std::string> text = ReadFile(path);
  if (!text) return text.error();
  const Result<CameraFile> file = ParseCameraFile(*text, path, with_depth);
  if (!file) return file.error();
  const Result<Rectifier> rectifier = Rectifier::Create(file->camera);
  if (!rectifier) {
    return Error{ErrorCode::kCorruptData, path + ": " + rectifier.error().message};
  }
  sequence->rectifier = *rectifier;
  sequence->camera = rectifier->ideal();
  sequence->depth_scale = file->depth_scale;
  return Ok();
}

}  // namespace

Result<TumSequence> ReadTumSequence(const std::string& directory) {
  TumSequence sequence;
  sequence.directory = directory;
  if (!Exists(directory)) return Error{ErrorCode::kNotFound, directory + ": no such directory"};
  const bool with_depth = Exists(directory + "/depth.txt");
  if (const Status read = ReadCamera(directory + "/camera.json", with_depth, &sequence); !read) {
    return read.error();
  }
  const Result<std::vector<StampedFile>> images = ReadFileList(directory, "rgb.txt");
  if (!images) return images.error();
  std::vector<StampedFile> depth;
  if (with_depth) {
    Result<std::vector<StampedFile>> listed = ReadFileList(directory, "depth.txt");
    if (!listed) return listed.error();
    depth = *std::move(listed);
  }
  Trajectory truth;
  if (const std::string path = directory + "/groundtruth.txt"; Exists(path)) {
    Result<Trajectory> read = ReadTumTrajectory(path);
    if (!read) return read.error();
    truth = *std::move(read);
  }
  sequence.frames.reserve((*images).size());
  for (const StampedFile& image : *images) {
    SequenceFrame frame;
    frame.timestamp_ns = image.timestamp_ns;
    frame.color_path = image.path;
    if (const auto nearest = Nearest(depth, image.timestamp_ns, kMaxDepthDelayNs)) {
      frame.depth_path = depth[*nearest].path;
    }
    frame.cam_from_world = PoseAt(truth, image.timestamp_ns);
    sequence.frames.push_back(std::move(frame));
  }
  return sequence;
}

Result<std::vector<SequenceFrame>> SelectFrames(const TumSequence& sequence,
                                                const std::string& list_path) {
  const Result<std::string> text = ReadFile(list_path);
  if (!text) return text.error();
  std::vector<SequenceFrame> selected;
  std::vector<int> named_in_line(sequence.frames.size(), 0);
  for (const DataLine& line : DataLines(*text)) {
    const auto corrupt = [&](const std::string& message) {
      return Error{ErrorCode::kCorruptData, Place(list_path, line) + ": " + message};
    };
    // Further fields are ignored, so that rgb.txt or a trajectory serves as a list too.
    const Result<int64_t> timestamp_ns = ParseTimestamp(line.fields[0]);
    if (!timestamp_ns) return corrupt(timestamp_ns.error().message);
    const auto frame = Nearest(sequence.frames, *timestamp_ns, kSameFrameNs);
    if (!frame) {
      return corrupt("timestamp " + std::string(line.fields[0]) + " names no frame of " +
                     sequence.directory + "/rgb.txt");
    }
    if (named_in_line[*frame] != 0) {
      return corrupt("timestamp " + std::string(line.fields[0]) + " names the frame of line " +
                     std::to_string(named_in_line[*frame]) + " again");
    }
    named_in_line[*frame] = line.number;
    selected.push_back(sequence.frames[*frame]);
  }
  if (selected.empty()) return Error{ErrorCode::kCorruptData, list_path + ": names no frame"};
  return selected;
}

Status CheckFilesExist(const std::vector<SequenceFrame>& frames, bool with_depth) {
  for (const SequenceFrame& frame : frames) {
    if (!Exists(frame.color_path)) {
      return Error{ErrorCode::kNotFound, frame.color_path + ": no such image"};
    }
    if (!with_depth) continue;
    if (!frame.depth_path) {
      return Error{ErrorCode::kNotFound, "frame " + FormatTimestamp(frame.timestamp_ns) +
                                             " has no depth image within 20 ms in depth.txt"};
    }
    if (!Exists(*frame.depth_path)) {
      return Error{ErrorCode::kNotFound, *frame.depth_path + ": no such depth image"};
    }
  }
  return Ok();
}

}  // namespace plumb::tools
