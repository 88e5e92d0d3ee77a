// The records of a map file: a LineMap as five tiles of fixed little-endian records, and back.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "plumb/base/result.h"
#include "plumb/map/line_map.h"

namespace plumb {

/// Kinds of records, in the order of the tiles.
enum class TileKind : uint8_t { kLines, kSightings, kKeyFrames, kSegments, kPoints };
inline constexpr size_t kNumTileKinds = 5;

/// Bytes of one record:
/// - line 84: end points 6 f32 | covariances (xx xy xz yy yz zz) 12 f32 | observing, expected,
///   sightings u32
/// - sighting 20: key frame u32 | direction 3 f32 | distance f32
/// - key frame 112: timestamp i64 | q_xyzw 4 f64 | translation 3 f64 | fx fy cx cy 4 f64 | width,
///   height, segments, points u32; pose = cam_from_world
/// - segment 48: image 4 f32, score f32 | end points 6 f32 | line u32, 2^32 - 1 for none
/// - point 148: pixel 2 f32 | point 3 f32 | descriptor 128 u8
/// End points and points are relative to the origin. Records of a line or a key frame follow each
/// other in its order.
size_t RecordBytes(TileKind kind);

/// "lines", "sightings", "key_frames", "segments", "points".
std::string_view TileName(TileKind kind);

/// One string a kind.
using MapTiles = std::array<std::string, kNumTileKinds>;

/// Whole metres near the first key frame's centre; zero without key frames.
Eigen::Vector3d ChooseOrigin(const LineMap& map);

/// Precondition: CheckMap(map). The encoding of a decoded map is the same again.
MapTiles EncodeTiles(const LineMap& map, const Eigen::Vector3d& origin);

/// Fills the lines, sightings and key frames of the map. Checks sizes and counts, not values.
/// @return kCorruptData when a tile is no whole number of records, or the counts in the records of
///         lines and key frames do not add up to the sightings, segments and points there are.
Result<LineMap> DecodeTiles(const MapTiles& tiles, const Eigen::Vector3d& origin);

}  // namespace plumb
