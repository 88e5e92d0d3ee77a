#include "plumb/map/map_tiles.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

namespace plumb {
namespace {

static_assert(std::numeric_limits<float>::is_iec559 && std::numeric_limits<double>::is_iec559);

constexpr uint32_t kNoLine = std::numeric_limits<uint32_t>::max();
constexpr std::array<size_t, kNumTileKinds> kRecordBytes = {84, 20, 112, 48, 148};
constexpr std::array<std::string_view, kNumTileKinds> kNames = {"lines", "sightings", "key_frames",
                                                                "segments", "points"};

template <typename T>
using Bits = std::conditional_t<sizeof(T) == 8, uint64_t, uint32_t>;

/// Appends little-endian numbers.
class RecordWriter {
 public:
  RecordWriter(size_t bytes, const Eigen::Vector3d& origin) : origin_(origin) {
    bytes_.reserve(bytes);
  }

  template <typename T>
  void Put(T value) {
    auto bits = std::bit_cast<Bits<T>>(value);
    for (size_t i = 0; i < sizeof(T); ++i, bits >>= 8) bytes_.push_back(static_cast<char>(bits));
  }
  void PutFloat(double value) { Put(static_cast<float>(value)); }

  /// A point in the world. A reader adds the origin again and rounds to the type of the field; what
  /// remains after that rounding is stored, so that reading and writing again changes nothing.
  template <typename Scalar>
  void PutPoint(const Eigen::Matrix<Scalar, 3, 1>& point) {
    for (int i = 0; i < 3; ++i) {
      const auto first = static_cast<float>(static_cast<double>(point[i]) - origin_[i]);
      const auto read = static_cast<Scalar>(origin_[i] + static_cast<double>(first));
      PutFloat(static_cast<double>(read) - origin_[i]);
    }
  }
  void PutSegment(const Segment3& segment) {
    PutPoint(segment.start);
    PutPoint(segment.end);
  }
  void PutCovariance(const Eigen::Matrix3d& matrix) {
    for (int row = 0; row < 3; ++row) {
      for (int column = row; column < 3; ++column) PutFloat(matrix(row, column));
    }
  }
  void PutBytes(const uint8_t* data, size_t size) {
    bytes_.append(reinterpret_cast<const char*>(data), size);
  }

  std::string Take() { return std::move(bytes_); }

 private:
  Eigen::Vector3d origin_;
  std::string bytes_;
};

/// Reads what RecordWriter wrote. The caller has checked that enough bytes are there.
class RecordReader {
 public:
  RecordReader(std::string_view bytes, const Eigen::Vector3d& origin)
      : bytes_(bytes), origin_(origin) {}

  template <typename T>
  T Get() {
    Bits<T> bits = 0;
    for (size_t i = 0; i < sizeof(T); ++i) {
      bits |= static_cast<Bits<T>>(static_cast<uint8_t>(bytes_[position_ + i])) << (8 * i);
    }
    position_ += sizeof(T);
    return std::bit_cast<T>(bits);
  }
  double GetFloat() { return static_cast<double>(Get<float>()); }

  template <typename Scalar>
  Eigen::Matrix<Scalar, 3, 1> GetPoint() {
    Eigen::Matrix<Scalar, 3, 1> point;
    for (int i = 0; i < 3; ++i) point[i] = static_cast<Scalar>(origin_[i] + GetFloat());
    return point;
  }
  Segment3 GetSegment() {
    Segment3 segment;
    segment.start = GetPoint<double>();
    segment.end = GetPoint<double>();
    return segment;
  }
  Eigen::Matrix3d GetCovariance() {
    Eigen::Matrix3d matrix;
    for (int row = 0; row < 3; ++row) {
      for (int column = row; column < 3; ++column) {
        matrix(row, column) = GetFloat();
        matrix(column, row) = matrix(row, column);
      }
    }
    return matrix;
  }
  void GetBytes(uint8_t* out, size_t size) {
    std::memcpy(out, bytes_.data() + position_, size);
    position_ += size;
  }

 private:
  std::string_view bytes_;
  Eigen::Vector3d origin_;
  size_t position_ = 0;
};

size_t Index(TileKind kind) { return static_cast<size_t>(kind); }

void PutLine(const MapLine& line, size_t num_sightings, RecordWriter* out) {
  out->PutSegment(line.segment_in_world);
  out->PutCovariance(line.covariance_start);
  out->PutCovariance(line.covariance_end);
  out->Put(line.num_observing);
  out->Put(line.num_expected);
  out->Put(static_cast<uint32_t>(num_sightings));
}

void PutSighting(const LineSighting& sighting, RecordWriter* out) {
  out->Put(sighting.key_frame);
  for (int i = 0; i < 3; ++i) out->Put(sighting.direction_to_camera[i]);
  out->Put(sighting.distance_m);
}

void PutKeyFrame(const KeyFrame& key_frame, RecordWriter* out) {
  out->Put(key_frame.timestamp_ns);
  for (int i = 0; i < 4; ++i) out->Put(key_frame.cam_from_world.rotation.coeffs()[i]);
  for (int i = 0; i < 3; ++i) out->Put(key_frame.cam_from_world.translation[i]);
  const Camera& camera = key_frame.camera;
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) out->Put(value);
  out->Put(camera.width_px);
  out->Put(camera.height_px);
  out->Put(static_cast<uint32_t>(key_frame.segments.size()));
  out->Put(static_cast<uint32_t>(key_frame.points.size()));
}

void PutLifted(const LiftedSegment& segment, RecordWriter* out) {
  for (const Eigen::Vector2d& end : {segment.segment_px.start, segment.segment_px.end}) {
    out->PutFloat(end.x());
    out->PutFloat(end.y());
  }
  out->PutFloat(segment.segment_px.score);
  out->PutSegment(segment.segment_in_world);
  out->Put(segment.line.value_or(kNoLine));
}

void PutMapPoint(const MapPoint& point, RecordWriter* out) {
  out->Put(point.pixel.x());
  out->Put(point.pixel.y());
  out->PutPoint(point.point_in_world);
  out->PutBytes(point.descriptor.data(), point.descriptor.size());
}

MapLine GetLine(RecordReader* in) {
  MapLine line;
  line.segment_in_world = in->GetSegment();
  line.covariance_start = in->GetCovariance();
  line.covariance_end = in->GetCovariance();
  line.num_observing = in->Get<uint32_t>();
  line.num_expected = in->Get<uint32_t>();
  return line;
}

LineSighting GetSighting(RecordReader* in) {
  LineSighting sighting;
  sighting.key_frame = in->Get<uint32_t>();
  for (int i = 0; i < 3; ++i) sighting.direction_to_camera[i] = in->Get<float>();
  sighting.distance_m = in->Get<float>();
  return sighting;
}

KeyFrame GetKeyFrame(RecordReader* in) {
  KeyFrame key_frame;
  key_frame.timestamp_ns = in->Get<int64_t>();
  for (int i = 0; i < 4; ++i) key_frame.cam_from_world.rotation.coeffs()[i] = in->Get<double>();
  for (int i = 0; i < 3; ++i) key_frame.cam_from_world.translation[i] = in->Get<double>();
  Camera& camera = key_frame.camera;
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value = in->Get<double>();
  camera.width_px = in->Get<int32_t>();
  camera.height_px = in->Get<int32_t>();
  return key_frame;
}

LiftedSegment GetLifted(RecordReader* in) {
  LiftedSegment segment;
  for (Eigen::Vector2d* end : {&segment.segment_px.start, &segment.segment_px.end}) {
    end->x() = in->GetFloat();
    end->y() = in->GetFloat();
  }
  segment.segment_px.score = in->GetFloat();
  segment.segment_in_world = in->GetSegment();
  if (const auto line = in->Get<uint32_t>(); line != kNoLine) segment.line = line;
  return segment;
}

MapPoint GetMapPoint(RecordReader* in) {
  MapPoint point;
  point.pixel.x() = in->Get<float>();
  point.pixel.y() = in->Get<float>();
  point.point_in_world = in->GetPoint<float>();
  in->GetBytes(point.descriptor.data(), point.descriptor.size());
  return point;
}

Error WrongCount(std::string_view what, size_t counted, size_t present) {
  return {ErrorCode::kCorruptData, "The map's records count " + std::to_string(counted) + " " +
                                       std::string(what) + " where " + std::to_string(present) +
                                       " are present"};
}

}  // namespace

size_t RecordBytes(TileKind kind) { return kRecordBytes[Index(kind)]; }
std::string_view TileName(TileKind kind) { return kNames[Index(kind)]; }

Eigen::Vector3d ChooseOrigin(const LineMap& map) {
  if (map.key_frames.empty()) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d center = map.key_frames.front().cam_from_world.Center();
  // "+ 0.0" makes -0 a 0.
  return center.unaryExpr([](double x) { return std::round(x) + 0.0; });
}

MapTiles EncodeTiles(const LineMap& map, const Eigen::Vector3d& origin) {
  size_t num_segments = 0, num_points = 0;
  for (const KeyFrame& key_frame : map.key_frames) {
    num_segments += key_frame.segments.size();
    num_points += key_frame.points.size();
  }
  const auto writer = [&](TileKind kind, size_t count) {
    return RecordWriter(RecordBytes(kind) * count, origin);
  };
  RecordWriter lines = writer(TileKind::kLines, map.lines.size());
  RecordWriter sightings = writer(TileKind::kSightings, map.sightings.size());
  RecordWriter key_frames = writer(TileKind::kKeyFrames, map.key_frames.size());
  RecordWriter segments = writer(TileKind::kSegments, num_segments);
  RecordWriter points = writer(TileKind::kPoints, num_points);

  for (size_t i = 0; i < map.lines.size(); ++i) {
    PutLine(map.lines[i], map.sighting_begin[i + 1] - map.sighting_begin[i], &lines);
  }
  for (const LineSighting& sighting : map.sightings) PutSighting(sighting, &sightings);
  for (const KeyFrame& key_frame : map.key_frames) {
    PutKeyFrame(key_frame, &key_frames);
    for (const LiftedSegment& segment : key_frame.segments) PutLifted(segment, &segments);
    for (const MapPoint& point : key_frame.points) PutMapPoint(point, &points);
  }
  return {lines.Take(), sightings.Take(), key_frames.Take(), segments.Take(), points.Take()};
}

Result<LineMap> DecodeTiles(const MapTiles& tiles, const Eigen::Vector3d& origin) {
  std::array<size_t, kNumTileKinds> count = {};
  for (size_t i = 0; i < kNumTileKinds; ++i) {
    if (tiles[i].size() % kRecordBytes[i] != 0) {
      return Error{ErrorCode::kCorruptData, "Tile " + std::string(kNames[i]) + " has " +
                                                std::to_string(tiles[i].size()) +
                                                " bytes, no whole number of records"};
    }
    count[i] = tiles[i].size() / kRecordBytes[i];
  }
  const auto reader = [&](TileKind kind) { return RecordReader(tiles[Index(kind)], origin); };
  const size_t num_sightings = count[Index(TileKind::kSightings)];
  const size_t num_segments = count[Index(TileKind::kSegments)];
  const size_t num_points = count[Index(TileKind::kPoints)];
  if (num_sightings > std::numeric_limits<uint32_t>::max()) {
    return Error{ErrorCode::kCorruptData, "The map has more than 2^32 sightings"};
  }

  LineMap map;
  RecordReader lines = reader(TileKind::kLines);
  map.lines.reserve(count[Index(TileKind::kLines)]);
  map.sighting_begin.reserve(count[Index(TileKind::kLines)] + 1);
  uint64_t end = 0;
  for (size_t i = 0; i < count[Index(TileKind::kLines)]; ++i) {
    map.lines.push_back(GetLine(&lines));
    end += lines.Get<uint32_t>();
    if (end > num_sightings) return WrongCount("sightings", end, num_sightings);
    map.sighting_begin.push_back(static_cast<uint32_t>(end));
  }
  if (end != num_sightings) return WrongCount("sightings", end, num_sightings);

  RecordReader sightings = reader(TileKind::kSightings);
  map.sightings.reserve(num_sightings);
  for (size_t i = 0; i < num_sightings; ++i) map.sightings.push_back(GetSighting(&sightings));

  RecordReader key_frames = reader(TileKind::kKeyFrames);
  RecordReader segments = reader(TileKind::kSegments);
  RecordReader points = reader(TileKind::kPoints);
  map.key_frames.reserve(count[Index(TileKind::kKeyFrames)]);
  uint64_t segments_end = 0, points_end = 0;
  for (size_t i = 0; i < count[Index(TileKind::kKeyFrames)]; ++i) {
    KeyFrame key_frame = GetKeyFrame(&key_frames);
    const auto own_segments = key_frames.Get<uint32_t>();
    const auto own_points = key_frames.Get<uint32_t>();
    segments_end += own_segments;
    points_end += own_points;
    if (segments_end > num_segments) return WrongCount("segments", segments_end, num_segments);
    if (points_end > num_points) return WrongCount("points", points_end, num_points);
    key_frame.segments.reserve(own_segments);
    for (uint32_t k = 0; k < own_segments; ++k) key_frame.segments.push_back(GetLifted(&segments));
    key_frame.points.reserve(own_points);
    for (uint32_t k = 0; k < own_points; ++k) key_frame.points.push_back(GetMapPoint(&points));
    map.key_frames.push_back(std::move(key_frame));
  }
  if (segments_end != num_segments) return WrongCount("segments", segments_end, num_segments);
  if (points_end != num_points) return WrongCount("points", points_end, num_points);
  return map;
}

}  // namespace plumb
