#include "plumb/map/map_check.h"

#include <cmath>
#include <string>

#include "plumb/base/plain_name.h"

namespace plumb {
namespace {

constexpr double kRounding = 1e-6;  // of a covariance's entries, relative to the largest
constexpr double kUnitTolerance = 1e-3;
constexpr int kMaxImageSide = 65536;
constexpr double kMaxCoordinate = 1e7;  // [m] or [px]; also keeps float32 records finite

Error Bad(const std::string& object, size_t index, const std::string& what) {
  return {ErrorCode::kInvalidArgument, object + " " + std::to_string(index) + " " + what};
}

template <typename Vector>
bool IsCoordinate(const Vector& x) {
  return x.allFinite() && x.cwiseAbs().maxCoeff() <= kMaxCoordinate;
}

template <typename Segment>
bool HasLength(const Segment& segment) {
  return IsCoordinate(segment.start) && IsCoordinate(segment.end) && segment.Length() > 0.0;
}

bool IsCovariance(const Eigen::Matrix3d& matrix) {
  const double largest = matrix.cwiseAbs().maxCoeff();
  return matrix.allFinite() && largest <= kMaxCoordinate * kMaxCoordinate &&
         matrix.diagonal().minCoeff() >= -kRounding * largest &&
         (matrix - matrix.transpose()).cwiseAbs().maxCoeff() <= kRounding * largest;
}

Status CheckLines(const LineMap& map) {
  for (size_t i = 0; i < map.lines.size(); ++i) {
    const MapLine& line = map.lines[i];
    if (!HasLength(line.segment_in_world)) return Bad("Line", i, "has no finite, positive length");
    if (!IsCovariance(line.covariance_start) || !IsCovariance(line.covariance_end)) {
      return Bad("Line", i, "has a covariance that is not finite, symmetric and non-negative");
    }
    if (line.num_observing < 1 || line.num_observing > line.num_expected) {
      return Bad("Line", i,
                 "is observed by " + std::to_string(line.num_observing) + " of " +
                     std::to_string(line.num_expected) + " expected key frames");
    }
  }
  return Ok();
}

Status CheckSightings(const LineMap& map) {
  const auto& begin = map.sighting_begin;
  if (begin.size() != map.lines.size() + 1 || begin.front() != 0 ||
      begin.back() != map.sightings.size()) {
    return Error{ErrorCode::kInvalidArgument,
                 "The sighting ranges do not cover " + std::to_string(map.sightings.size()) +
                     " sightings of " + std::to_string(map.lines.size()) + " lines"};
  }
  for (size_t i = 0; i + 1 < begin.size(); ++i) {
    if (begin[i] > begin[i + 1]) return Bad("Line", i, "has a sighting range of negative length");
  }
  for (size_t i = 0; i < map.lines.size(); ++i) {
    for (size_t k = begin[i]; k < begin[i + 1]; ++k) {
      const LineSighting& sighting = map.sightings[k];
      if (sighting.key_frame >= map.key_frames.size()) {
        return Bad("Sighting", k,
                   "refers to key frame " + std::to_string(sighting.key_frame) + " of " +
                       std::to_string(map.key_frames.size()));
      }
      if (k > begin[i] && sighting.key_frame <= map.sightings[k - 1].key_frame) {
        return Bad("Sighting", k, "breaks the ascending order of the line's key frames");
      }
      const float norm = sighting.direction_to_camera.norm();
      if (!(std::abs(norm - 1.0f) <= kUnitTolerance)) {
        return Bad("Sighting", k, "has a direction of length " + std::to_string(norm));
      }
      if (!(sighting.distance_m > 0.0f && sighting.distance_m <= 2 * kMaxCoordinate)) {
        return Bad("Sighting", k,
                   "has a distance of " + std::to_string(sighting.distance_m) + " m");
      }
    }
  }
  return Ok();
}

Status CheckSegments(const KeyFrame& key_frame, size_t index, size_t num_lines) {
  for (const LiftedSegment& segment : key_frame.segments) {
    if (!HasLength(segment.segment_px) || !HasLength(segment.segment_in_world)) {
      return Bad("Key frame", index, "has a segment without finite, positive length");
    }
    if (!(segment.segment_px.score >= 0.0 && segment.segment_px.score <= 1.0)) {
      return Bad("Key frame", index,
                 "has a segment with score " + std::to_string(segment.segment_px.score));
    }
    if (segment.line && *segment.line >= num_lines) {
      return Bad("Key frame", index,
                 "has a segment of line " + std::to_string(*segment.line) + " of " +
                     std::to_string(num_lines));
    }
  }
  for (const MapPoint& point : key_frame.points) {
    if (!IsCoordinate(point.pixel) || !IsCoordinate(point.point_in_world)) {
      return Bad("Key frame", index, "has a point that is not finite or out of range");
    }
  }
  return Ok();
}

Status CheckKeyFrames(const LineMap& map) {
  for (size_t i = 0; i < map.key_frames.size(); ++i) {
    const KeyFrame& key_frame = map.key_frames[i];
    if (!key_frame.cam_from_world.rotation.coeffs().allFinite() ||
        !IsCoordinate(key_frame.cam_from_world.translation) ||
        std::abs(key_frame.cam_from_world.rotation.norm() - 1.0) > kUnitTolerance) {
      return Bad("Key frame", i, "has a pose that is not finite, out of range or not a rotation");
    }
    if (!key_frame.camera.IsValid() || key_frame.camera.width_px > kMaxImageSide ||
        key_frame.camera.height_px > kMaxImageSide) {
      return Bad("Key frame", i, "has invalid intrinsics or image size");
    }
    if (Status status = CheckSegments(key_frame, i, map.lines.size()); !status) return status;
  }
  return Ok();
}

}  // namespace

Status CheckMap(const LineMap& map) {
  if (!(map.covariance_factor > 0.0) || !std::isfinite(map.covariance_factor)) {
    return Error{ErrorCode::kInvalidArgument, "The covariance factor is " +
                                                  std::to_string(map.covariance_factor) +
                                                  ", not a positive number"};
  }
  if (!(map.covariance_growth >= 0.0) || !std::isfinite(map.covariance_growth)) {
    return Error{ErrorCode::kInvalidArgument, "The covariance growth is " +
                                                  std::to_string(map.covariance_growth) +
                                                  ", not a number from 0"};
  }
  const auto is_length = [](double value) { return std::isfinite(value) && value >= 0.0; };
  if (map.pose_change &&
      !(is_length(map.pose_change->position_m) && is_length(map.pose_change->rotation_rad))) {
    return Error{ErrorCode::kInvalidArgument, "The change of the poses is not a number from 0"};
  }
  if (map.camera_correction) {
    for (const ImageCamera* camera :
         {&map.camera_correction->given, &map.camera_correction->corrected}) {
      const Result<Rectifier> rectifier = Rectifier::Create(*camera);
      if (rectifier) continue;
      return Error{ErrorCode::kInvalidArgument,
                   "The correction of the camera: " + rectifier.error().message};
    }
    const Camera& given = map.camera_correction->given.pinhole;
    const Camera& corrected = map.camera_correction->corrected.pinhole;
    if (given.width_px != corrected.width_px || given.height_px != corrected.height_px ||
        given.fx * corrected.fx < 0.0 || given.fy * corrected.fy < 0.0) {
      return Error{ErrorCode::kInvalidArgument,
                   "The correction of the camera changes its size or mirrors it"};
    }
  }
  if (!IsPlainName(map.detector)) {
    return Error{ErrorCode::kInvalidArgument,
                 "The detector's name is not up to 63 letters, digits, '_' and '-'"};
  }
  if (Status status = CheckLines(map); !status) return status;
  if (Status status = CheckSightings(map); !status) return status;
  return CheckKeyFrames(map);
}

}  // namespace plumb
