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
    if (const StampedFile* nearest =
            NearestInTime<StampedFile>(depth, image.timestamp_ns, kMaxDepthDelayNs)) {
      frame.depth_path = nearest->path;
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
    const SequenceFrame* frame =
        NearestInTime<SequenceFrame>(sequence.frames, *timestamp_ns, kSameFrameNs);
    if (!frame) {
      return corrupt("timestamp " + std::string(line.fields[0]) + " names no frame of " +
                     sequence.directory + "/rgb.txt");
    }
    int& named = named_in_line[static_cast<size_t>(frame - sequence.frames.data())];
    if (named != 0) {
      return corrupt("timestamp " + std::string(line.fields[0]) + " names the frame of line " +
                     std::to_string(named) + " again");
    }
    named = line.number;
    selected.push_back(*frame);
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
