// camera.json: intrinsics, lens and depth scale of a sequence.
#include "tools/datasets/camera_file.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "plumb/base/json_depth.h"
#include "tools/datasets/text_file.h"

namespace plumb::tools {
namespace {

using Json = nlohmann::json;

constexpr int kMaxSidePx = 16384;
constexpr double kMinDepthScale = 1e-3, kMaxDepthScale = 1e6;
constexpr const char* kCoefficients = "distortion_coefficients";

struct ModelName {
  const char* name;
  LensModel model;
  size_t num_coefficients;  // 0: as many as the model takes
};
constexpr ModelName kModelNames[] = {{"PINHOLE", LensModel::kNone, 0},
                                     {"RADTAN", LensModel::kRadTan, 0},
                                     {"OPENCV", LensModel::kRadTan, 4},
                                     {"FULL_OPENCV", LensModel::kRadTan, 8},
                                     {"KANNALA_BRANDT", LensModel::kKannalaBrandt, 4},
                                     {"OPENCV_FISHEYE", LensModel::kKannalaBrandt, 4}};

std::string Shown(const Json& value) { return Shortened(value.dump()); }

/// Reads members and says which one is wrong.
class MemberReader {
 public:
  MemberReader(const Json& json, const std::string& path) : json_(json), path_(path) {}

  Error Corrupt(const std::string& message) const {
    return {ErrorCode::kCorruptData, path_ + ": " + message};
  }

  Status Number(const char* key, double* out) const {
    if (!json_.contains(key)) return Corrupt(std::string("\"") + key + "\" is missing");
    const Json& value = json_[key];
    if (!value.is_number() || !std::isfinite(value.get<double>())) {
      return Corrupt(std::string("\"") + key + "\" is " + Shown(value) + ", no number");
    }
    *out = value.get<double>();
    return Ok();
  }

  Status Side(const char* key, int* out) const {
    double value = 0.0;
    if (const Status read = Number(key, &value); !read) return read.error();
    if (!(value >= 1.0 && value <= kMaxSidePx && value == std::floor(value))) {
      return Corrupt(std::string("\"") + key + "\" is " + Shown(json_[key]) + ", want 1 to 16384");
    }
    *out = static_cast<int>(value);
    return Ok();
  }

  Result<Lens> ReadLens() const {
    const ModelName* model = &kModelNames[0];
    if (json_.contains("model")) {
      const Json& name = json_["model"];
      model = std::find_if(std::begin(kModelNames), std::end(kModelNames),
                           [&](const ModelName& known) { return name == known.name; });
      if (model == std::end(kModelNames)) {
        std::string known;
        for (const ModelName& entry : kModelNames) known += std::string(" ") + entry.name;
        return Error{ErrorCode::kUnsupported,
                     path_ + ": \"model\" is " + Shown(name) + ", known are" + known};
      }
    }
    if (!json_.contains(kCoefficients)) {
      if (model->model == LensModel::kNone) return Lens{};
      return Corrupt(std::string("\"") + kCoefficients + "\" is missing, " + model->name +
                     " needs it");
    }
    const Json& values = json_[kCoefficients];
    const auto wrong = [&](const std::string& what) {
      return Corrupt(std::string("\"") + kCoefficients + "\" is " + Shown(values) + ": " + what);
    };
    if (!values.is_array()) return wrong("no array of numbers");
    std::vector<double> numbers;
    for (const Json& value : values) {
      if (!value.is_number() || !std::isfinite(value.get<double>())) {
        return wrong(Shown(value) + " is no number");
      }
      numbers.push_back(value.get<double>());
    }
    if (model->model == LensModel::kNone) {
      const auto is_zero = [](double value) { return value == 0.0; };
      if (std::all_of(numbers.begin(), numbers.end(), is_zero)) return Lens{};
      return wrong("PINHOLE has none, RADTAN and KANNALA_BRANDT do");
    }
    if (model->num_coefficients != 0 && numbers.size() != model->num_coefficients) {
      return wrong(std::string(model->name) + " has " + std::to_string(model->num_coefficients));
    }
    const Result<Lens> lens = MakeLens(model->model, numbers);
    if (!lens) return wrong(lens.error().message);
    return *lens;
  }

 private:
  const Json& json_;
  const std::string& path_;
};

}  // namespace

Result<CameraFile> ParseCameraFile(const std::string& text, const std::string& path,
                                   bool needs_depth_scale) {
  const bool shallow = IsShallowJson(text);
  const Json json = shallow ? Json::parse(text, nullptr, false) : Json();
  const MemberReader reader(json, path);
  if (!shallow) return reader.Corrupt("is nested too deeply");
  if (!json.is_object()) return reader.Corrupt("is no JSON object");
  CameraFile file;
  const Result<Lens> lens = reader.ReadLens();
  if (!lens) return lens.error();
  file.camera.lens = *lens;
  Camera& camera = file.camera.pinhole;
  const std::pair<const char*, int*> sides[] = {{"width", &camera.width_px},
                                                {"height", &camera.height_px}};
  for (const auto& [key, value] : sides) {
    if (const Status read = reader.Side(key, value); !read) return read.error();
  }
  const std::pair<const char*, double*> numbers[] = {
      {"fx", &camera.fx}, {"fy", &camera.fy}, {"cx", &camera.cx}, {"cy", &camera.cy}};
  for (const auto& [key, value] : numbers) {
    if (const Status read = reader.Number(key, value); !read) return read.error();
  }
  if (!camera.IsValid()) return reader.Corrupt("\"fx\" or \"fy\" is 0");
  if (!needs_depth_scale && !json.contains("depth_scale")) return file;
  if (const Status read = reader.Number("depth_scale", &file.depth_scale); !read) {
    return read.error();
  }
  if (!(file.depth_scale >= kMinDepthScale && file.depth_scale <= kMaxDepthScale)) {
    return reader.Corrupt("\"depth_scale\" is " + Shown(json["depth_scale"]) +
                          ", want 1e-3 to 1e6 units per metre");
  }
  return file;
}

std::string FormatCameraFile(const CameraFile& file, const std::string& source) {
  const Camera& camera = file.camera.pinhole;
  const Lens& lens = file.camera.lens;
  nlohmann::ordered_json json = {
      {"model", lens.IsNone() ? "PINHOLE" : std::string(ToString(lens.model))},
      {"width", camera.width_px},
      {"height", camera.height_px},
      {"fx", camera.fx},
      {"fy", camera.fy},
      {"cx", camera.cx},
      {"cy", camera.cy}};
  if (!lens.IsNone()) {
    const bool is_long = lens.model == LensModel::kRadTan;
    json[kCoefficients] = std::vector<double>(lens.coefficients.begin(),
                                              lens.coefficients.begin() + (is_long ? 8 : 4));
  }
  if (file.depth_scale > 0.0) json["depth_scale"] = file.depth_scale;
  json["source"] = source;
  return json.dump(1) + "\n";
}

}  // namespace plumb::tools
