// Trajectories in TUM format: "timestamp tx ty tz qx qy qz qw", camera-to-world.
#include "tools/datasets/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "tools/datasets/text_file.h"
#include "tools/datasets/timestamp.h"

namespace plumb::tools {
namespace {

constexpr double kMaxNormError = 1e-3;
constexpr int64_t kSameTimeNs = 1'000;
constexpr int64_t kMaxGapNs = 50'000'000;
constexpr size_t kNumFields = 8;

Error Corrupt(const std::string& path, const DataLine& line, const std::string& message) {
  return Error{ErrorCode::kCorruptData, Place(path, line) + ": " + message};
}

Result<StampedPose> ParsePose(const std::string& path, const DataLine& line) {
  if (line.fields.size() != kNumFields) {
    return Corrupt(path, line,
                   std::to_string(line.fields.size()) +
                       " fields, a pose has 8: timestamp tx ty tz qx qy qz qw");
  }
  const Result<int64_t> timestamp_ns = ParseTimestamp(line.fields[0]);
  if (!timestamp_ns) return Corrupt(path, line, timestamp_ns.error().message);
  std::array<double, 7> v{};
  for (size_t i = 0; i < v.size(); ++i) {
    const Result<double> number = ParseNumber(line.fields[i + 1]);
    if (!number) return Corrupt(path, line, number.error().message);
    v[i] = *number;
  }
  const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
  if (std::abs(rotation.norm() - 1.0) > kMaxNormError) {
    return Corrupt(path, line,
                   "the quaternion's norm is " + std::to_string(rotation.norm()) + ", not 1");
  }
  const Rigid3 world_from_cam{rotation.normalized(), {v[0], v[1], v[2]}};
  if (!(world_from_cam.translation.norm() <= kMaxPoseDistanceM)) {
    return Corrupt(path, line, "the camera lies more than 1e7 m from the origin");
  }
  return StampedPose{*timestamp_ns, world_from_cam.Inverse()};
}

/// First pose that is not earlier than `timestamp_ns`.
std::span<const StampedPose>::iterator LowerBound(std::span<const StampedPose> trajectory,
                                                  int64_t timestamp_ns) {
  return std::lower_bound(
      trajectory.begin(), trajectory.end(), timestamp_ns,
      [](const StampedPose& pose, int64_t value) { return pose.timestamp_ns < value; });
}

}  // namespace

Result<Trajectory> ReadTumTrajectory(const std::string& path) {
  const Result<std::string> text = ReadFile(path);
  if (!text) return text.error();
  const std::vector<DataLine> lines = DataLines(*text);
  if (lines.empty()) return Error{ErrorCode::kCorruptData, path + ": holds no pose"};
  std::vector<std::pair<StampedPose, const DataLine*>> poses;
  poses.reserve(lines.size());
  for (const DataLine& line : lines) {
    Result<StampedPose> pose = ParsePose(path, line);
    if (!pose) return pose.error();
    poses.emplace_back(*pose, &line);
  }
  std::stable_sort(poses.begin(), poses.end(), [](const auto& a, const auto& b) {
    return a.first.timestamp_ns < b.first.timestamp_ns;
  });
  Trajectory trajectory;
  trajectory.reserve(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    if (i > 0 && poses[i].first.timestamp_ns == poses[i - 1].first.timestamp_ns) {
      return Corrupt(path, *poses[i].second,
                     "timestamp " + FormatTimestamp(poses[i].first.timestamp_ns) +
                         " was given in line " + std::to_string(poses[i - 1].second->number) +
                         " already");
    }
    trajectory.push_back(poses[i].first);
  }
  return trajectory;
}

std::string FormatTumTrajectory(std::span<const StampedPose> trajectory) {
  std::string text = "# timestamp tx ty tz qx qy qz qw (camera-to-world)\n";
  char numbers[7 * 26];
  for (const StampedPose& pose : trajectory) {
    const Rigid3 world_from_cam = pose.cam_from_world.Inverse();
    const Eigen::Vector3d& t = world_from_cam.translation;
    const Eigen::Quaterniond& q = world_from_cam.rotation;
    std::snprintf(numbers, sizeof(numbers), " %.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", t.x(),
                  t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    text += FormatTimestamp(pose.timestamp_ns);
    text += numbers;
  }
  return text;
}

std::optional<Rigid3> PoseAt(std::span<const StampedPose> trajectory, int64_t timestamp_ns) {
  if (const StampedPose* same = NearestPose(trajectory, timestamp_ns, kSameTimeNs)) {
    return same->cam_from_world;
  }
  const auto after = LowerBound(trajectory, timestamp_ns);
  if (after == trajectory.begin() || after == trajectory.end()) return std::nullopt;
  const StampedPose& b = *after;
  const StampedPose& a = *std::prev(after);
  // Timestamps far apart have no difference that fits.
  if (a.timestamp_ns < b.timestamp_ns - kMaxGapNs) return std::nullopt;
  const int64_t gap_ns = b.timestamp_ns - a.timestamp_ns;
  const double share =
      static_cast<double>(timestamp_ns - a.timestamp_ns) / static_cast<double>(gap_ns);
  // The camera's centre moves on a line, hence in the world's frame.
  const Rigid3 world_from_a = a.cam_from_world.Inverse();
  const Rigid3 world_from_b = b.cam_from_world.Inverse();
  const Rigid3 world_from_cam{
      world_from_a.rotation.slerp(share, world_from_b.rotation).normalized(),
      (1.0 - share) * world_from_a.translation + share * world_from_b.translation};
  return world_from_cam.Inverse();
}

const StampedPose* NearestPose(std::span<const StampedPose> trajectory, int64_t timestamp_ns,
                               int64_t tolerance_ns) {
  return NearestInTime(trajectory, timestamp_ns, tolerance_ns);
}

}  // namespace plumb::tools
