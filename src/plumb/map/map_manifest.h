// manifest.json of a map: what the tiles are, and a checksum over the manifest itself.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "plumb/base/result.h"
#include "plumb/map/depth_source.h"
#include "plumb/map/line_map.h"
#include "plumb/map/map_tiles.h"

namespace plumb {

inline constexpr std::string_view kMapSchema = "plumb.map/1";

struct TileEntry {
  std::string file;  // name inside the directory "tiles"
  uint64_t records = 0;
  uint64_t bytes = 0;
  uint64_t xxh3 = 0;  // XXH3-64 of the file, seed 0
};

struct MapManifest {
  std::string detector;
  DepthSource depth_source = DepthSource::kSensor;
  double covariance_factor = kUncalibratedFactor, covariance_growth = 0.0;
  std::optional<PoseChange> pose_change;
  std::optional<CameraCorrection> camera_correction;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  std::array<TileEntry, kNumTileKinds> tiles;  // in the order of TileKind
};

/// XXH3-64 with seed 0.
uint64_t Checksum(std::string_view bytes);

MapManifest DescribeTiles(const MapTiles& tiles);

/// JSON whose last member "xxh3" is the checksum of every byte before that member's value.
std::string WriteManifest(const MapManifest& manifest);

/// Checks the checksum first (it must be the end of the text, byte for byte), then the nesting,
/// the schema, the types and the ranges, and that records times their size are the bytes.
/// @return kUnsupported for a manifest of another version, kCorruptData for everything else.
Result<MapManifest> ParseManifest(std::string_view text);

}  // namespace plumb
