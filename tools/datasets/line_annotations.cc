// Annotated line segments of benchmark images: images/ and annotations.json.
#include "tools/datasets/line_annotations.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "plumb/base/json_depth.h"
#include "tools/datasets/text_file.h"

namespace plumb::tools {
namespace {

constexpr double kMaxCoordinatePx = 1 << 20;

Result<nlohmann::json> ReadJsonArray(const std::string& path) {
  const Result<std::string> text = ReadFile(path);
  if (!text) return text.error();
  if (!IsShallowJson(*text)) {
    return Error{ErrorCode::kCorruptData, path + ": is nested too deeply"};
  }
  nlohmann::json json = nlohmann::json::parse(*text, nullptr, false);
  if (!json.is_array() || json.empty()) {
    return Error{ErrorCode::kCorruptData, path + ": is no JSON array with at least one image"};
  }
  return json;
}

/// Appends the segments of [[x1, y1, x2, y2], ..]. @return false if it is not that.
bool ParseLines(const nlohmann::json& lines, std::vector<Segment2>* out_segments) {
  if (!lines.is_array()) return false;
  for (const nlohmann::json& line : lines) {
    const bool four_numbers =
        line.is_array() && line.size() == 4 &&
        std::all_of(line.begin(), line.end(), [](const nlohmann::json& v) {
          return v.is_number() && std::abs(v.get<double>()) <= kMaxCoordinatePx;
        });
    if (!four_numbers) return false;
    Segment2 segment;
    segment.start = {line[0].get<double>(), line[1].get<double>()};
    segment.end = {line[2].get<double>(), line[3].get<double>()};
    out_segments->push_back(segment);
  }
  return true;
}

std::string FileName(const std::string& path) { return path.substr(path.rfind('/') + 1); }

}  // namespace

Result<std::vector<AnnotatedImage>> ReadLineAnnotations(const std::string& directory,
                                                        const std::string& image_folder) {
  const std::string path = directory + "/annotations.json";
  const Result<nlohmann::json> json = ReadJsonArray(path);
  if (!json) return json.error();
  std::vector<AnnotatedImage> images;
  for (size_t i = 0; i < (*json).size(); ++i) {
    const nlohmann::json& entry = (*json)[i];
    const auto corrupt = [&](const char* want) {
      return Error{ErrorCode::kCorruptData,
                   path + ": image " + std::to_string(i) + ": want " + want};
    };
    if (!entry.is_object() || !entry.contains("filename") || !entry["filename"].is_string()) {
      return corrupt("a \"filename\"");
    }
    AnnotatedImage image;
    image.path = directory + "/" + image_folder + "/" + entry["filename"].get<std::string>();
    for (const auto& [key, value] :
         {std::pair("width", &image.width_px), std::pair("height", &image.height_px)}) {
      if (!entry.contains(key) || !entry[key].is_number_integer() || entry[key] < 1 ||
          entry[key] > 1 << 20) {
        return corrupt("integer \"width\" and \"height\" of at least 1");
      }
      *value = entry[key].get<int>();
    }
    if (!entry.contains("lines")) return corrupt("\"lines\"");
    if (!ParseLines(entry["lines"], &image.lines)) {
      return corrupt("four numbers a line: [x1, y1, x2, y2], in pixels");
    }
    images.push_back(std::move(image));
  }
  return images;
}

Result<std::vector<std::vector<Segment2>>> ReadDetections(
    const std::string& path, const std::vector<AnnotatedImage>& images) {
  const Result<nlohmann::json> json = ReadJsonArray(path);
  if (!json) return json.error();
  std::map<std::string, std::vector<Segment2>> segments_of;
  for (size_t i = 0; i < (*json).size(); ++i) {
    const nlohmann::json& entry = (*json)[i];
    const auto corrupt = [&](const char* want) {
      return Error{ErrorCode::kCorruptData,
                   path + ": image " + std::to_string(i) + ": want " + want};
    };
    if (!entry.is_object() || !entry.contains("file") || !entry["file"].is_string()) {
      return corrupt("a \"file\"");
    }
    std::vector<Segment2> segments;
    if (!entry.contains("lines") || !ParseLines(entry["lines"], &segments)) {
      return corrupt("\"lines\": [[x1, y1, x2, y2], ..], in pixels");
    }
    const auto scores = entry.find("scores");
    if (scores == entry.end() || !scores->is_array() || scores->size() != segments.size() ||
        !std::all_of(scores->begin(), scores->end(), [](const auto& v) { return v.is_number(); })) {
      return corrupt("\"scores\", one number a line");
    }
    for (size_t k = 0; k < segments.size(); ++k) segments[k].score = (*scores)[k].get<double>();
    const std::string name = FileName(entry["file"].get<std::string>());
    if (!segments_of.emplace(name, std::move(segments)).second) {
      return corrupt(("every file once, " + Shortened(name) + " is there before").c_str());
    }
  }
  std::vector<std::vector<Segment2>> found;
  for (const AnnotatedImage& image : images) {
    const auto of_image = segments_of.find(FileName(image.path));
    if (of_image == segments_of.end()) {
      return Error{ErrorCode::kCorruptData, path + ": has no entry for " + image.path};
    }
    found.push_back(of_image->second);
  }
  return found;
}

}  // namespace plumb::tools
