// Annotated line segments of benchmark images: images/ and annotations.json.
#include "tools/datasets/line_annotations.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "tools/datasets/text_file.h"

namespace plumb::tools {

Result<std::vector<AnnotatedImage>> ReadLineAnnotations(const std::string& directory,
                                                        const std::string& image_folder) {
  const std::string path = directory + "/annotations.json";
  const Result<std::string> text = ReadFile(path);
  if (!text) return text.error();
  const nlohmann::json json = nlohmann::json::parse(*text, nullptr, false);
  if (!json.is_array() || json.empty()) {
    return Error{ErrorCode::kCorruptData, path + ": is no JSON array with at least one image"};
  }
  std::vector<AnnotatedImage> images;
  for (size_t i = 0; i < json.size(); ++i) {
    const nlohmann::json& entry = json[i];
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
    if (!entry.contains("lines") || !entry["lines"].is_array()) return corrupt("\"lines\"");
    for (const nlohmann::json& line : entry["lines"]) {
      const bool four_numbers = line.is_array() && line.size() == 4 &&
                                std::all_of(line.begin(), line.end(), [](const nlohmann::json& v) {
                                  return v.is_number() && std::isfinite(v.get<double>());
                                });
      if (!four_numbers) return corrupt("four numbers a line: [x1, y1, x2, y2]");
      Segment2 segment;
      segment.start = {line[0].get<double>(), line[1].get<double>()};
      segment.end = {line[2].get<double>(), line[3].get<double>()};
      image.lines.push_back(segment);
    }
    images.push_back(std::move(image));
  }
  return images;
}

}  // namespace plumb::tools
