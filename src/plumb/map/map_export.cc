#include "plumb/map/map_export.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <vector>

#include "plumb/base/file.h"

namespace plumb {
namespace {

template <typename Bits>
void PutLittleEndian(Bits bits, std::string* out) {
  for (size_t i = 0; i < sizeof(Bits); ++i) out->push_back(static_cast<char>(bits >> (8 * i)));
}

double SigmaOf(const MapLine& line) {
  return std::sqrt(std::max({0.0, line.covariance_start.trace(), line.covariance_end.trace()}));
}

/// Shortest digits that read back as the same number, in any locale.
void PutNumber(double value, std::string* out) {
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  out->append(text.data(), end);
}

std::string Ply(const std::vector<const MapLine*>& lines) {
  std::string out =
      "ply\nformat binary_little_endian 1.0\ncomment plumbline map, world coordinates in metres\n"
      "element vertex " +
      std::to_string(2 * lines.size()) +
      "\nproperty double x\nproperty double y\nproperty double z\nelement edge " +
      std::to_string(lines.size()) +
      "\nproperty int vertex1\nproperty int vertex2\nproperty uint observing\n"
      "property float sigma_m\nend_header\n";
  for (const MapLine* line : lines) {
    for (const Eigen::Vector3d& x : {line->segment_in_world.start, line->segment_in_world.end}) {
      for (int i = 0; i < 3; ++i) PutLittleEndian(std::bit_cast<uint64_t>(x[i]), &out);
    }
  }
  for (uint32_t i = 0; i < lines.size(); ++i) {
    PutLittleEndian(2 * i, &out);
    PutLittleEndian(2 * i + 1, &out);
    PutLittleEndian(lines[i]->num_observing, &out);
    PutLittleEndian(std::bit_cast<uint32_t>(static_cast<float>(SigmaOf(*lines[i]))), &out);
  }
  return out;
}

std::string Obj(const std::vector<const MapLine*>& lines) {
  std::string out = "# plumbline map, world coordinates in metres\n";
  for (const MapLine* line : lines) {
    for (const Eigen::Vector3d& x : {line->segment_in_world.start, line->segment_in_world.end}) {
      out += "v";
      for (int i = 0; i < 3; ++i) {
        out += " ";
        PutNumber(x[i], &out);
      }
      out += "\n";
    }
  }
  for (size_t i = 0; i < lines.size(); ++i) {
    out += "l " + std::to_string(2 * i + 1) + " " + std::to_string(2 * i + 2) + "\n";
  }
  return out;
}

}  // namespace

Status ExportLines(const LineMap& map, const std::string& path, const MapExportOptions& options) {
  std::vector<const MapLine*> lines;
  for (const MapLine& line : map.lines) {
    if (line.num_observing >= options.min_observing) lines.push_back(&line);
  }
  if (lines.size() > size_t{1} << 30) {
    return Error{ErrorCode::kInvalidArgument, "The map has " + std::to_string(lines.size()) +
                                                  " lines, more than the format holds"};
  }
  return WriteFileAtomically(path,
                             options.format == MapExportFormat::kPly ? Ply(lines) : Obj(lines));
}

}  // namespace plumb
