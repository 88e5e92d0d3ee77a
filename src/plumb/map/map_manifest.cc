#include "plumb/map/map_manifest.h"

#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "plumb/base/json_depth.h"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMaxOrigin = 1e7;
constexpr uint64_t kMaxSidePx = 65536;
constexpr std::string_view kChecksumKey = "  \"xxh3\": \"";
constexpr std::string_view kEnd = "\"\n}\n";

std::string Hex(uint64_t value) {
  std::array<char, 17> text = {};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(value));
  return text.data();
}

std::optional<uint64_t> ParseHex(const std::string& text) {
  if (text.size() != 16) return std::nullopt;
  uint64_t value = 0;
  for (const char c : text) {
    const bool is_digit = c >= '0' && c <= '9';
    if (!is_digit && !(c >= 'a' && c <= 'f')) return std::nullopt;
    value = value << 4 | static_cast<uint64_t>(is_digit ? c - '0' : c - 'a' + 10);
  }
  return value;
}

Error Corrupt(const std::string& what) {
  return {ErrorCode::kCorruptData, "The map's manifest " + what};
}

const Json* Member(const Json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(key);
  return found == object.end() ? nullptr : &*found;
}

std::optional<std::string> TextOf(const Json& object, const char* key) {
  const Json* value = Member(object, key);
  if (value == nullptr || !value->is_string()) return std::nullopt;
  return value->get<std::string>();
}

std::optional<uint64_t> CountOf(const Json& object, const char* key) {
  const Json* value = Member(object, key);
  if (value == nullptr || !value->is_number_unsigned()) return std::nullopt;
  return value->get<uint64_t>();
}

std::optional<double> NumberOf(const Json* value) {
  if (value == nullptr || !value->is_number()) return std::nullopt;
  const auto number = value->get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

/// Names are plain, so that no manifest can make a reader leave the directory.
bool IsPlainName(const std::string& name) {
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.';
  };
  return !name.empty() && name.size() <= 64 && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), is_plain);
}

Result<TileEntry> ParseTile(const Json& tile, TileKind kind) {
  const std::string name(TileName(kind));
  const auto listed_kind = TextOf(tile, "kind");
  const auto file = TextOf(tile, "file");
  const auto records = CountOf(tile, "records");
  const auto bytes = CountOf(tile, "bytes");
  const auto hex = TextOf(tile, "xxh3");
  const auto xxh3 = hex ? ParseHex(*hex) : std::nullopt;
  if (!listed_kind || !file || !records || !bytes || !xxh3) {
    return Corrupt("lacks a member of tile " + name + ", or it has the wrong type");
  }
  if (*listed_kind != name)
    return Corrupt("lists tile " + *listed_kind + " in the place of " + name);
  if (!IsPlainName(*file)) return Corrupt("names a file that is not inside the map: " + *file);
  if (*records > std::numeric_limits<uint32_t>::max() || *bytes != *records * RecordBytes(kind)) {
    return Corrupt("gives tile " + name + " " + std::to_string(*bytes) + " bytes for " +
                   std::to_string(*records) + " records");
  }
  return TileEntry{*file, *records, *bytes, *xxh3};
}

Json CameraJson(const ImageCamera& camera) {
  const Camera& pinhole = camera.pinhole;
  return {{"width", pinhole.width_px},
          {"height", pinhole.height_px},
          {"fx", pinhole.fx},
          {"fy", pinhole.fy},
          {"cx", pinhole.cx},
          {"cy", pinhole.cy},
          {"lens", ToString(camera.lens.model)},
          {"coefficients", camera.lens.coefficients}};
}

/// All members as CameraJson() writes them; whether it is a camera, CheckMap() says.
std::optional<ImageCamera> ParseCamera(const Json* json) {
  if (json == nullptr) return std::nullopt;
  ImageCamera camera;
  Camera& pinhole = camera.pinhole;
  const std::pair<const char*, int*> sides[] = {{"width", &pinhole.width_px},
                                                {"height", &pinhole.height_px}};
  for (const auto& [key, value] : sides) {
    const auto side = CountOf(*json, key);
    if (!side || *side > kMaxSidePx) return std::nullopt;
    *value = static_cast<int>(*side);
  }
  const std::pair<const char*, double*> numbers[] = {
      {"fx", &pinhole.fx}, {"fy", &pinhole.fy}, {"cx", &pinhole.cx}, {"cy", &pinhole.cy}};
  for (const auto& [key, value] : numbers) {
    const auto number = NumberOf(Member(*json, key));
    if (!number) return std::nullopt;
    *value = *number;
  }
  const auto lens = TextOf(*json, "lens");
  const Json* coefficients = Member(*json, "coefficients");
  const std::array models = {LensModel::kNone, LensModel::kRadTan, LensModel::kKannalaBrandt};
  const auto* const model = std::find_if(models.begin(), models.end(), [&](LensModel known) {
    return lens && *lens == ToString(known);
  });
  if (model == models.end() || coefficients == nullptr || !coefficients->is_array() ||
      coefficients->size() != camera.lens.coefficients.size()) {
    return std::nullopt;
  }
  camera.lens.model = *model;
  for (size_t i = 0; i < camera.lens.coefficients.size(); ++i) {
    const auto number = NumberOf(&(*coefficients)[i]);
    if (!number) return std::nullopt;
    camera.lens.coefficients[i] = *number;
  }
  return camera;
}

Result<MapManifest> ParseMembers(const Json& root) {
  const auto schema = TextOf(root, "schema");
  if (!schema) return Corrupt("has no schema");
  if (*schema != kMapSchema) {
    return Error{ErrorCode::kUnsupported, "The map has schema " + *schema +
                                              ", this program reads " + std::string(kMapSchema)};
  }
  MapManifest manifest;
  const auto detector = TextOf(root, "detector");
  if (!detector) return Corrupt("has no detector");
  manifest.detector = *detector;

  if (Member(root, "depth") != nullptr) {  // absent in older maps
    const auto depth = TextOf(root, "depth");
    const auto source = depth ? DepthSourceOf(*depth) : std::nullopt;
    if (!source) return Corrupt("has a depth that is none of sensor, views and both");
    manifest.depth_source = *source;
  }

  const auto factor = NumberOf(Member(root, "covariance_factor"));
  if (!factor) return Corrupt("has no covariance_factor");
  manifest.covariance_factor = *factor;
  if (const Json* member = Member(root, "covariance_growth")) {  // absent in older maps
    const auto growth = NumberOf(member);
    if (!growth) return Corrupt("has a covariance_growth that is no number");
    manifest.covariance_growth = *growth;
  }

  if (const Json* member = Member(root, "pose_change")) {  // only of adjusted maps
    const auto position = NumberOf(Member(*member, "position_m"));
    const auto rotation = NumberOf(Member(*member, "rotation_rad"));
    if (!position || !rotation) return Corrupt("has a pose_change without its two numbers");
    manifest.pose_change = PoseChange{*position, *rotation};
  }

  if (const Json* member = Member(root, "camera")) {  // only where it was corrected
    const auto given = ParseCamera(Member(*member, "given"));
    const auto corrected = ParseCamera(Member(*member, "corrected"));
    if (!given || !corrected) return Corrupt("has a camera that is not one, given and corrected");
    manifest.camera_correction = CameraCorrection{*given, *corrected};
  }

  const Json* origin = Member(root, "origin");
  if (origin == nullptr || !origin->is_array() || origin->size() != 3) {
    return Corrupt("has no origin of three numbers");
  }
  for (int i = 0; i < 3; ++i) {
    const auto value = NumberOf(&(*origin)[static_cast<size_t>(i)]);
    if (!value || std::abs(*value) > kMaxOrigin) return Corrupt("has an origin out of range");
    manifest.origin[i] = *value;
  }

  const Json* tiles = Member(root, "tiles");
  if (tiles == nullptr || !tiles->is_array() || tiles->size() != kNumTileKinds) {
    return Corrupt("does not list " + std::to_string(kNumTileKinds) + " tiles");
  }
  for (size_t i = 0; i < kNumTileKinds; ++i) {
    Result<TileEntry> tile = ParseTile((*tiles)[i], static_cast<TileKind>(i));
    if (!tile) return tile.error();
    manifest.tiles[i] = *std::move(tile);
  }
  return manifest;
}

}  // namespace

uint64_t Checksum(std::string_view bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

MapManifest DescribeTiles(const MapTiles& tiles) {
  MapManifest manifest;
  for (size_t i = 0; i < kNumTileKinds; ++i) {
    const auto kind = static_cast<TileKind>(i);
    manifest.tiles[i] = {std::string(TileName(kind)) + ".plt", tiles[i].size() / RecordBytes(kind),
                         tiles[i].size(), Checksum(tiles[i])};
  }
  return manifest;
}

std::string WriteManifest(const MapManifest& manifest) {
  Json tiles = Json::array();
  for (size_t i = 0; i < kNumTileKinds; ++i) {
    const TileEntry& tile = manifest.tiles[i];
    tiles.push_back({{"kind", TileName(static_cast<TileKind>(i))},
                     {"file", tile.file},
                     {"records", tile.records},
                     {"bytes", tile.bytes},
                     {"xxh3", Hex(tile.xxh3)}});
  }
  Json root = {
      {"schema", kMapSchema},
      {"detector", manifest.detector},
      {"depth", NameOf(manifest.depth_source)},
      {"covariance_factor", manifest.covariance_factor},
      {"covariance_growth", manifest.covariance_growth},
  };
  if (manifest.pose_change) {
    root["pose_change"] = {{"position_m", manifest.pose_change->position_m},
                           {"rotation_rad", manifest.pose_change->rotation_rad}};
  }
  if (manifest.camera_correction) {
    root["camera"] = {{"given", CameraJson(manifest.camera_correction->given)},
                      {"corrected", CameraJson(manifest.camera_correction->corrected)}};
  }
  root["origin"] = {manifest.origin.x(), manifest.origin.y(), manifest.origin.z()};
  root["tiles"] = std::move(tiles);
  std::string text = root.dump(2, ' ', false, Json::error_handler_t::replace);
  text.resize(text.size() - 2);  // "\n}"
  text += ",\n";
  text += kChecksumKey;
  return text + Hex(Checksum(text)) + std::string(kEnd);
}

Result<MapManifest> ParseManifest(std::string_view text) {
  const size_t tail = 16 + kEnd.size();
  if (text.size() < kChecksumKey.size() + tail) return Corrupt("is cut off");
  const std::string_view body = text.substr(0, text.size() - tail);
  if (!body.ends_with(kChecksumKey) ||
      text.substr(body.size()) != Hex(Checksum(body)) + std::string(kEnd)) {
    return Corrupt("does not match its checksum");
  }
  if (!IsShallowJson(text)) return Corrupt("is nested too deeply");
  const Json root = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (root.is_discarded()) return Corrupt("is not JSON");
  return ParseMembers(root);
}

}  // namespace plumb
