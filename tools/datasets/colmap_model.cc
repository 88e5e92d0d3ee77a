#include "tools/datasets/colmap_model.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include "tools/datasets/text_file.h"
#include "tools/datasets/trajectory.h"

namespace plumb::tools {
namespace {

constexpr double kUnitTolerance = 1e-3;     // of a quaternion's norm
constexpr double kHalfPixel = 0.5;          // COLMAP: the first pixel's centre is (0.5, 0.5)
constexpr uint64_t kMaxSidePx = 16384;      // as in camera.json
constexpr size_t kMaxNameBytes = 4096;      // a path
constexpr size_t kObservationBytes = 24;    // x, y, point's id
constexpr uint64_t kFewestImageBytes = 73;  // with an empty name and no observations

/// Where COLMAP's parameters of a model go.
struct ModelLayout {
  int32_t id;
  std::string_view name;
  size_t num_parameters;
  bool is_known = false;
  bool one_focal = false;  // f instead of fx fy
  LensModel lens = LensModel::kNone;
  size_t num_coefficients = 0;  // in the file, after the principal point
};
constexpr ModelLayout kLayouts[] = {
    {0, "SIMPLE_PINHOLE", 3, true, true},
    {1, "PINHOLE", 4, true, false},
    {2, "SIMPLE_RADIAL", 4, true, true, LensModel::kRadTan, 1},
    {3, "RADIAL", 5, true, true, LensModel::kRadTan, 2},
    {4, "OPENCV", 8, true, false, LensModel::kRadTan, 4},
    {5, "OPENCV_FISHEYE", 8, true, false, LensModel::kKannalaBrandt, 4},
    {6, "FULL_OPENCV", 12, true, false, LensModel::kRadTan, 8},
    {7, "FOV", 5},
    {8, "SIMPLE_RADIAL_FISHEYE", 4},
    {9, "RADIAL_FISHEYE", 5},
    {10, "THIN_PRISM_FISHEYE", 12},
    {11, "RAD_TAN_THIN_PRISM_FISHEYE", 16},
};

/// A camera as the file has it, whatever its model.
struct RawCamera {
  std::string place;  // for messages
  std::string model;
  const ModelLayout* layout = nullptr;
  uint64_t width_px = 0, height_px = 0;
  std::vector<double> parameters;
};

struct RawImage {
  std::string place;
  ColmapImage image;
  uint32_t camera_id = 0;
  std::array<double, 4> q_wxyz{};
};

using RawCameras = std::map<uint32_t, RawCamera>;

Error Corrupt(const std::string& place, const std::string& what) {
  return {ErrorCode::kCorruptData, place + ": " + what};
}

Result<ImageCamera> Convert(uint32_t id, const RawCamera& raw) {
  const std::string place = raw.place + ": camera " + std::to_string(id);
  if (raw.layout == nullptr || !raw.layout->is_known) {
    return Error{ErrorCode::kUnsupported,
                 place + " has the model " + raw.model +
                     ", known are SIMPLE_PINHOLE PINHOLE SIMPLE_RADIAL RADIAL OPENCV "
                     "OPENCV_FISHEYE FULL_OPENCV"};
  }
  if (raw.width_px < 1 || raw.height_px < 1 || raw.width_px > kMaxSidePx ||
      raw.height_px > kMaxSidePx) {
    return Corrupt(place, "has an image of " + std::to_string(raw.width_px) + " x " +
                              std::to_string(raw.height_px) + " px, outside 1..16384");
  }
  for (const double value : raw.parameters) {
    if (!std::isfinite(value)) return Corrupt(place, "has a parameter that is not finite");
  }
  ImageCamera out;
  const double* next = raw.parameters.data();
  Camera& pinhole = out.pinhole;
  pinhole.fx = *next++;
  pinhole.fy = raw.layout->one_focal ? pinhole.fx : *next++;
  pinhole.cx = *next++ - kHalfPixel;
  pinhole.cy = *next++ - kHalfPixel;
  pinhole.width_px = static_cast<int>(raw.width_px);
  pinhole.height_px = static_cast<int>(raw.height_px);
  if (!(pinhole.fx > 0.0 && pinhole.fy > 0.0)) {
    return Corrupt(place, "has a focal length that is not positive");
  }
  if (raw.layout->lens == LensModel::kNone) return out;
  std::vector<double> coefficients(next, next + raw.layout->num_coefficients);
  coefficients.resize(std::max<size_t>(coefficients.size(), 4), 0.0);
  const Result<Lens> lens = MakeLens(raw.layout->lens, coefficients);
  if (!lens) return Corrupt(place, lens.error().message);
  out.lens = *lens;
  return out;
}

Result<ColmapModel> Assemble(const RawCameras& cameras, std::vector<RawImage> images,
                             const std::string& images_path) {
  if (images.empty()) return Corrupt(images_path, "names no image");
  ColmapModel model;
  std::map<uint32_t, size_t> index_of;
  for (const RawImage& raw : images) {
    if (!cameras.contains(raw.camera_id)) {
      return Corrupt(raw.place, "image " + std::to_string(raw.image.id) + " has the camera " +
                                    std::to_string(raw.camera_id) + ", which is not in the model");
    }
    index_of[raw.camera_id] = 0;
  }
  for (auto& [id, index] : index_of) {
    Result<ImageCamera> camera = Convert(id, cameras.at(id));
    if (!camera) return camera.error();
    index = model.cameras.size();
    model.cameras.push_back({id, *std::move(camera)});
  }
  for (RawImage& raw : images) {
    const std::string image = "image " + std::to_string(raw.image.id);
    const auto& [w, x, y, z] = raw.q_wxyz;
    const Eigen::Quaterniond rotation(w, x, y, z);
    if (!rotation.coeffs().allFinite() || !raw.image.cam_from_world.translation.allFinite()) {
      return Corrupt(raw.place, image + " has a pose that is not finite");
    }
    if (!(raw.image.cam_from_world.translation.norm() <= kMaxPoseDistanceM)) {
      return Corrupt(raw.place, image + " lies more than 1e7 m from the origin");
    }
    if (!(std::abs(rotation.norm() - 1.0) <= kUnitTolerance)) {
      return Corrupt(raw.place, image + " has a quaternion with a norm of " +
                                    std::to_string(rotation.norm()) + ", not 1");
    }
    if (raw.image.name.empty()) return Corrupt(raw.place, image + " has no name");
    raw.image.cam_from_world.rotation = rotation.normalized();
    raw.image.camera = index_of[raw.camera_id];
    model.images.push_back(std::move(raw.image));
  }
  std::sort(model.images.begin(), model.images.end(),
            [](const ColmapImage& a, const ColmapImage& b) { return a.name < b.name; });
  std::vector<uint32_t> ids;
  for (size_t i = 0; i < model.images.size(); ++i) {
    ids.push_back(model.images[i].id);
    if (i > 0 && model.images[i].name == model.images[i - 1].name) {
      return Corrupt(images_path, "names the image " + model.images[i].name + " twice");
    }
  }
  std::sort(ids.begin(), ids.end());
  if (const auto twice = std::adjacent_find(ids.begin(), ids.end()); twice != ids.end()) {
    return Corrupt(images_path, "has the image " + std::to_string(*twice) + " twice");
  }
  return model;
}

// Text.

struct TextLine {
  int number = 0;
  std::string_view text;
};

/// All lines without comments. Empty ones stay: an image without observations has one.
std::vector<TextLine> TextLines(std::string_view text) {
  std::vector<TextLine> lines;
  for (int number = 1; !text.empty(); ++number) {
    const size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (!line.starts_with('#')) lines.push_back({number, line});
  }
  return lines;
}

bool IsBlank(std::string_view text) { return text.find_first_not_of(" \t") == text.npos; }

/// Takes the next field off `text`; empty at its end.
std::string_view TakeField(std::string_view* text) {
  text->remove_prefix(std::min(text->find_first_not_of(" \t"), text->size()));
  const std::string_view field = text->substr(0, text->find_first_of(" \t"));
  text->remove_prefix(field.size());
  return field;
}

template <typename Integer>
std::optional<Integer> ParseInteger(std::string_view field) {
  Integer value = 0;
  const auto [end, code] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (code != std::errc() || end != field.data() + field.size()) return std::nullopt;
  return value;
}

std::string PlaceOf(const std::string& path, const TextLine& line) {
  return path + ":" + std::to_string(line.number);
}

Result<RawCameras> ParseTextCameras(std::string_view text, const std::string& path) {
  RawCameras cameras;
  for (const TextLine& line : TextLines(text)) {
    if (IsBlank(line.text)) continue;
    RawCamera camera;
    camera.place = PlaceOf(path, line);
    std::string_view rest = line.text;
    const auto id = ParseInteger<uint32_t>(TakeField(&rest));
    camera.model = TakeField(&rest);
    const auto width = ParseInteger<uint64_t>(TakeField(&rest));
    const auto height = ParseInteger<uint64_t>(TakeField(&rest));
    if (!id || !width || !height) {
      return Corrupt(camera.place, "is no camera: want CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
    }
    camera.width_px = *width;
    camera.height_px = *height;
    const auto layout =
        std::find_if(std::begin(kLayouts), std::end(kLayouts),
                     [&](const ModelLayout& known) { return known.name == camera.model; });
    if (layout != std::end(kLayouts)) camera.layout = layout;
    for (std::string_view field = TakeField(&rest); !field.empty(); field = TakeField(&rest)) {
      const Result<double> value = ParseNumber(field);
      if (!value) return Corrupt(camera.place, value.error().message);
      camera.parameters.push_back(*value);
    }
    if (camera.layout != nullptr && camera.parameters.size() != camera.layout->num_parameters) {
      return Corrupt(camera.place, "camera " + std::to_string(*id) + " has " +
                                       std::to_string(camera.parameters.size()) + " parameters, " +
                                       camera.model + " has " +
                                       std::to_string(camera.layout->num_parameters));
    }
    const std::string place = camera.place;
    if (!cameras.emplace(*id, std::move(camera)).second) {
      return Corrupt(place, "has the camera " + std::to_string(*id) + " again");
    }
  }
  return cameras;
}

/// "X Y POINT3D_ID" repeated, or blank. Anything else is the next image where the line is missing.
bool IsObservations(std::string_view line) {
  for (std::string_view x = TakeField(&line); !x.empty(); x = TakeField(&line)) {
    if (!ParseNumber(x) || !ParseNumber(TakeField(&line)) ||
        !ParseInteger<int64_t>(TakeField(&line))) {
      return false;
    }
  }
  return true;
}

Result<std::vector<RawImage>> ParseTextImages(std::string_view text, const std::string& path) {
  std::vector<RawImage> images;
  const std::vector<TextLine> lines = TextLines(text);
  for (size_t i = 0; i < lines.size(); ++i) {
    if (IsBlank(lines[i].text)) continue;
    RawImage image;
    image.place = PlaceOf(path, lines[i]);
    std::string_view rest = lines[i].text;
    const auto id = ParseInteger<uint32_t>(TakeField(&rest));
    if (!id) {
      return Corrupt(image.place, "is no image: want IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
    }
    std::array<double, 7> pose;
    for (double& number : pose) {
      const Result<double> value = ParseNumber(TakeField(&rest));
      if (!value) return Corrupt(image.place, value.error().message);
      number = *value;
    }
    const auto camera_id = ParseInteger<uint32_t>(TakeField(&rest));
    if (!camera_id) return Corrupt(image.place, "has no CAMERA_ID");
    rest.remove_prefix(std::min(rest.find_first_not_of(" \t"), rest.size()));
    image.image.id = *id;
    image.image.name = rest;
    image.camera_id = *camera_id;
    image.q_wxyz = {pose[0], pose[1], pose[2], pose[3]};
    image.image.cam_from_world.translation = {pose[4], pose[5], pose[6]};
    images.push_back(std::move(image));
    ++i;  // the observations; the blank line of an image without any may lack at the file's end
    if (i < lines.size() && !IsObservations(lines[i].text)) {
      return Corrupt(PlaceOf(path, lines[i]), "is no line of observations of image " +
                                                  std::to_string(*id) +
                                                  ": want X Y POINT3D_ID .. or a blank line");
    }
  }
  return images;
}

// Binary, little endian.

/// Takes values off the front of bytes; after the first that is not there, none is.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  bool Take(T* out) {
    static_assert(std::endian::native == std::endian::little);
    if (bytes_.size() < sizeof(T)) return false;
    std::memcpy(out, bytes_.data(), sizeof(T));
    bytes_.remove_prefix(sizeof(T));
    return true;
  }
  bool TakeName(std::string* out) {
    const size_t end = bytes_.substr(0, kMaxNameBytes).find('\0');
    if (end == bytes_.npos) return false;
    *out = bytes_.substr(0, end);
    bytes_.remove_prefix(end + 1);
    return true;
  }
  bool Skip(uint64_t count, size_t size) {
    if (count > bytes_.size() / size) return false;
    bytes_.remove_prefix(count * size);
    return true;
  }
  size_t size() const { return bytes_.size(); }

 private:
  std::string_view bytes_;
};

Result<RawCameras> ParseBinaryCameras(std::string_view bytes, const std::string& path) {
  ByteReader reader(bytes);
  uint64_t count = 0;
  if (!reader.Take(&count)) return Corrupt(path, "ends before its number of cameras");
  RawCameras cameras;
  for (uint64_t k = 0; k < count; ++k) {
    const std::string record = "camera record " + std::to_string(k);
    uint32_t id = 0;
    int32_t model = 0;
    RawCamera camera;
    camera.place = path;
    if (!reader.Take(&id) || !reader.Take(&model) || !reader.Take(&camera.width_px) ||
        !reader.Take(&camera.height_px)) {
      return Corrupt(path, "ends inside " + record + " of " + std::to_string(count));
    }
    const auto layout =
        std::find_if(std::begin(kLayouts), std::end(kLayouts),
                     [model](const ModelLayout& known) { return known.id == model; });
    // How long the record of an unknown model is, is unknown too.
    if (layout == std::end(kLayouts)) {
      camera.model = "number " + std::to_string(model);
      return Convert(id, camera).error();
    }
    camera.layout = layout;
    camera.model = layout->name;
    camera.parameters.resize(layout->num_parameters);
    for (double& value : camera.parameters) {
      if (!reader.Take(&value)) {
        return Corrupt(path, "ends inside " + record + " of " + std::to_string(count));
      }
    }
    if (!cameras.emplace(id, std::move(camera)).second) {
      return Corrupt(path, "has the camera " + std::to_string(id) + " again");
    }
  }
  if (reader.size() != 0) {
    return Corrupt(path, std::to_string(reader.size()) + " bytes follow its last camera");
  }
  return cameras;
}

Result<std::vector<RawImage>> ParseBinaryImages(std::string_view bytes, const std::string& path) {
  ByteReader reader(bytes);
  uint64_t count = 0;
  if (!reader.Take(&count)) return Corrupt(path, "ends before its number of images");
  if (count > bytes.size() / kFewestImageBytes) {
    return Corrupt(path, "is too short for " + std::to_string(count) + " images");
  }
  std::vector<RawImage> images;
  for (uint64_t k = 0; k < count; ++k) {
    RawImage image;
    image.place = path;
    std::array<double, 3> translation{};
    uint64_t num_observations = 0;
    if (!reader.Take(&image.image.id) || !reader.Take(&image.q_wxyz) ||
        !reader.Take(&translation) || !reader.Take(&image.camera_id) ||
        !reader.TakeName(&image.image.name) || !reader.Take(&num_observations) ||
        !reader.Skip(num_observations, kObservationBytes)) {
      return Corrupt(
          path, "ends inside image record " + std::to_string(k) + " of " + std::to_string(count));
    }
    image.image.cam_from_world.translation = {translation[0], translation[1], translation[2]};
    images.push_back(std::move(image));
  }
  if (reader.size() != 0) {
    return Corrupt(path, std::to_string(reader.size()) + " bytes follow its last image");
  }
  return images;
}

bool Exists(const std::string& path) {
  std::error_code code;
  return std::filesystem::exists(path, code);
}

}  // namespace

Result<ColmapModel> ParseColmapText(std::string_view cameras, std::string_view images,
                                    const std::string& cameras_path,
                                    const std::string& images_path) {
  const Result<RawCameras> parsed_cameras = ParseTextCameras(cameras, cameras_path);
  if (!parsed_cameras) return parsed_cameras.error();
  Result<std::vector<RawImage>> parsed_images = ParseTextImages(images, images_path);
  if (!parsed_images) return parsed_images.error();
  return Assemble(*parsed_cameras, *std::move(parsed_images), images_path);
}

Result<ColmapModel> ParseColmapBinary(std::string_view cameras, std::string_view images,
                                      const std::string& cameras_path,
                                      const std::string& images_path) {
  const Result<RawCameras> parsed_cameras = ParseBinaryCameras(cameras, cameras_path);
  if (!parsed_cameras) return parsed_cameras.error();
  Result<std::vector<RawImage>> parsed_images = ParseBinaryImages(images, images_path);
  if (!parsed_images) return parsed_images.error();
  return Assemble(*parsed_cameras, *std::move(parsed_images), images_path);
}

Result<ColmapModel> ReadColmapModel(const std::string& directory) {
  const bool binary = Exists(directory + "/cameras.bin") && Exists(directory + "/images.bin");
  if (!binary && !(Exists(directory + "/cameras.txt") && Exists(directory + "/images.txt"))) {
    return Error{ErrorCode::kNotFound,
                 directory + ": no COLMAP model (cameras and images, .bin or .txt)"};
  }
  const std::string ending = binary ? ".bin" : ".txt";
  const std::string cameras_path = directory + "/cameras" + ending;
  const std::string images_path = directory + "/images" + ending;
  const Result<std::string> cameras = ReadFile(cameras_path);
  if (!cameras) return cameras.error();
  const Result<std::string> images = ReadFile(images_path);
  if (!images) return images.error();
  return binary ? ParseColmapBinary(*cameras, *images, cameras_path, images_path)
                : ParseColmapText(*cameras, *images, cameras_path, images_path);
}

}  // namespace plumb::tools
