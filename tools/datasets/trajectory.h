// Trajectories in TUM format: "timestamp tx ty tz qx qy qz qw", camera-to-world.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/geometry/rigid3.h"

namespace plumb::tools {

/// From the origin; what maps can hold. Farther off, poses are taken for broken.
inline constexpr double kMaxPoseDistanceM = 1e7;

/// The file's camera-to-world becomes cam_from_world here, as everywhere in memory.
struct StampedPose {
  int64_t timestamp_ns = 0;
  Rigid3 cam_from_world;
};

/// Ascending in time, every timestamp once.
using Trajectory = std::vector<StampedPose>;

/// Reads a TUM trajectory; lines may come in any order.
/// @return kNotFound; kCorruptData naming file, line and value for a wrong number of fields, a
///         number that is not finite, a camera more than kMaxPoseDistanceM from the origin, a
///         quaternion whose norm is off by more than 1e-3, a timestamp that occurs twice, or a file
///         without any pose.
Result<Trajectory> ReadTumTrajectory(const std::string& path);

/// Inverse of ReadTumTrajectory, 17 significant digits a number.
std::string FormatTumTrajectory(std::span<const StampedPose> trajectory);

/// The pose at a time: the recorded one if there is one within 1 us, else interpolated between the
/// two neighbours if they are at most 50 ms apart.
std::optional<Rigid3> PoseAt(std::span<const StampedPose> trajectory, int64_t timestamp_ns);

/// The recorded pose nearest in time, at most `tolerance_ns` away (ties: the earlier).
const StampedPose* NearestPose(std::span<const StampedPose> trajectory, int64_t timestamp_ns,
                               int64_t tolerance_ns);

}  // namespace plumb::tools
