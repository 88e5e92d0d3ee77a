#include "tools/synth/line_city.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "plumb/geometry/line_projection.h"

namespace plumb::synth {
namespace {

constexpr double kSide = 6.0, kHeight = 2.8;
constexpr uint32_t kLinesInRoom = 2000, kViewsInRoom = 25;
constexpr int kPanels = 80;  // of 4 lines; the rest are boxes of 12
constexpr double kMinLengthPx = 15.0;
constexpr double kSightingShare = 0.7;  // the others are hidden or not detected
constexpr double kPixelSigma = 0.4;

Eigen::Vector3d Normal3(Random* random) {
  return {random->Normal(), random->Normal(), random->Normal()};
}

/// Upright, turned by `yaw` and a little pitched.
Rigid3 PoseAtPlace(const Eigen::Vector3d& center, double yaw, double pitch) {
  const Eigen::Quaterniond rotation = ExpSo3({pitch, 0.0, 0.0}) * ExpSo3({0.0, yaw, 0.0});
  return {rotation.normalized(), -(rotation * center)};
}

void AddLine(const Eigen::Vector3d& a, const Eigen::Vector3d& b, LineMap* map) {
  MapLine line;
  line.segment_in_world = {a, b};
  const Eigen::Vector3d d = (b - a).normalized();
  line.covariance_start = line.covariance_end =
      4e-6 * (Eigen::Matrix3d::Identity() - d * d.transpose());
  map->lines.push_back(line);
}

/// What a depth camera makes of a point.
Eigen::Vector3d Lifted(const Rigid3& cam_from_world, const Eigen::Vector3d& x_in_world,
                       Random* random) {
  const Eigen::Vector3d x = cam_from_world * x_in_world;
  const double along = 0.004 * x.z() * x.z() + 0.003;
  return x_in_world +
         cam_from_world.rotation.conjugate() * (random->Normal() * along * x.normalized());
}

}  // namespace

LineCity::LineCity(const LineCityOptions& options) {
  Random random(options.seed);
  map_.detector = "synthetic";
  const uint32_t num_rooms = std::max(1u, (options.num_lines + kLinesInRoom - 1) / kLinesInRoom);
  const auto side = static_cast<uint32_t>(std::ceil(std::sqrt(num_rooms)));
  for (uint32_t room = 0; room < num_rooms; ++room) {
    AddRoom({kSide * (room % side), 0.0, kSide * (room / side)}, &random);
  }
}

void LineCity::AddRoom(const Eigen::Vector3d& corner, Random* random) {
  const auto first_line = static_cast<uint32_t>(map_.lines.size());
  const auto num_lines = [&] { return static_cast<uint32_t>(map_.lines.size()) - first_line; };
  for (int k = 0; k < kPanels; ++k) {
    const Eigen::Vector3d along = k % 2 == 0 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d across = k % 2 == 0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
    const Eigen::Vector3d start = corner + (k % 4 < 2 ? 0.0 : kSide) * across +
                                  random->Uniform(0.0, kSide - 1.0) * along +
                                  random->Uniform(0.0, kHeight - 0.8) * Eigen::Vector3d::UnitY();
    const Eigen::Vector3d a = random->Uniform(0.1, 1.0) * along;
    const Eigen::Vector3d b = random->Uniform(0.1, 0.8) * Eigen::Vector3d::UnitY();
    AddLine(start, start + a, &map_);
    AddLine(start + b, start + a + b, &map_);
    AddLine(start, start + b, &map_);
    AddLine(start + a, start + a + b, &map_);
  }
  while (num_lines() < kLinesInRoom) {
    const double yaw = random->Chance(0.8) ? 0.0 : random->Uniform(0.0, std::numbers::pi / 2);
    const Eigen::Vector3d size(random->Uniform(0.05, 0.8), random->Uniform(0.05, 0.8),
                               random->Uniform(0.05, 0.8));
    const Eigen::Vector3d start = corner + Eigen::Vector3d(random->Uniform(0.0, kSide - 0.8),
                                                           random->Uniform(0.0, kHeight - 0.8),
                                                           random->Uniform(0.0, kSide - 0.8));
    const Eigen::Quaterniond turn = ExpSo3({0.0, yaw, 0.0});
    const auto at = [&](int x, int y, int z) -> Eigen::Vector3d {
      return start + turn * Eigen::Vector3d(x * size.x(), y * size.y(), z * size.z());
    };
    for (int i = 0; i < 4 && num_lines() < kLinesInRoom; ++i) {
      const int p = i & 1, q = i >> 1;
      AddLine(at(0, p, q), at(1, p, q), &map_);
      AddLine(at(p, 0, q), at(p, 1, q), &map_);
      AddLine(at(p, q, 0), at(p, q, 1), &map_);
    }
  }
  AddKeyFrames(corner, first_line, random);
}

void LineCity::AddKeyFrames(const Eigen::Vector3d& corner, uint32_t first_line, Random* random) {
  const Camera camera = MakeCamera();
  const auto first_view = static_cast<uint32_t>(map_.key_frames.size());
  for (uint32_t k = 0; k < kViewsInRoom; ++k) {
    KeyFrame& key_frame = map_.key_frames.emplace_back();
    key_frame.timestamp_ns = 1'000'000'000LL * static_cast<int64_t>(map_.key_frames.size());
    key_frame.camera = camera;
    const Eigen::Vector3d center =
        corner + Eigen::Vector3d(random->Uniform(1.0, kSide - 1.0), random->Uniform(0.8, 1.6),
                                 random->Uniform(1.0, kSide - 1.0));
    key_frame.cam_from_world = PoseAtPlace(
        center, random->Uniform(-std::numbers::pi, std::numbers::pi), random->Uniform(-0.2, 0.2));
  }
  for (uint32_t i = first_line; i < map_.lines.size(); ++i) {
    MapLine& line = map_.lines[i];
    for (uint32_t k = first_view; k < map_.key_frames.size(); ++k) {
      KeyFrame& key_frame = map_.key_frames[k];
      const Rigid3& pose = key_frame.cam_from_world;
      const auto image = ProjectSegment(camera, pose, line.segment_in_world);
      if (!image || image->Length() < kMinLengthPx) continue;
      ++line.num_expected;
      if (!random->Chance(kSightingShare)) continue;
      ++line.num_observing;
      const Eigen::Vector3d ray = pose.Center() - line.segment_in_world.Midpoint();
      map_.sightings.push_back({k, ray.normalized().cast<float>(), static_cast<float>(ray.norm())});
      const Segment3 lifted{Lifted(pose, line.segment_in_world.start, random),
                            Lifted(pose, line.segment_in_world.end, random)};
      key_frame.segments.push_back({*image, lifted, i});
    }
    map_.sighting_begin.push_back(static_cast<uint32_t>(map_.sightings.size()));
  }
}

LineCity::Frame LineCity::MakeFrame(uint32_t num_segments, uint32_t num_points,
                                    Random* random) const {
  const Camera camera = MakeCamera();
  const uint32_t k = static_cast<uint32_t>(random->Index(static_cast<int>(map_.key_frames.size())));
  const uint32_t room = k / kViewsInRoom;
  const Rigid3& near = map_.key_frames[k].cam_from_world;
  Frame frame;
  const Eigen::Quaterniond rotation = (ExpSo3(0.05 * Normal3(random)) * near.rotation).normalized();
  frame.cam_from_world = {rotation, -(rotation * (near.Center() + 0.1 * Normal3(random)))};

  const auto noise = [&]() -> Eigen::Vector2d {
    return kPixelSigma * Eigen::Vector2d(random->Normal(), random->Normal());
  };
  for (uint32_t i = room * kLinesInRoom; i < (room + 1) * kLinesInRoom; ++i) {
    const auto image = ProjectSegment(camera, frame.cam_from_world, map_.lines[i].segment_in_world);
    if (!image || image->Length() < kMinLengthPx || map_.lines[i].num_observing == 0) continue;
    Segment2 segment{image->start + random->Uniform(0.0, 0.3) * image->Delta() + noise(),
                     image->end - random->Uniform(0.0, 0.3) * image->Delta() + noise()};
    if (random->Chance(0.5)) std::swap(segment.start, segment.end);
    frame.segments.push_back(segment);
  }
  for (size_t i = frame.segments.size(); i > 1; --i) {  // a random choice of them
    std::swap(frame.segments[i - 1],
              frame.segments[static_cast<size_t>(random->Index(static_cast<int>(i)))]);
  }
  frame.segments.resize(std::min<size_t>(frame.segments.size(), num_segments - num_segments / 6));
  while (frame.segments.size() < num_segments) {
    const Eigen::Vector2d middle(random->Uniform(0, camera.width_px),
                                 random->Uniform(0, camera.height_px));
    const double angle = random->Uniform(0.0, std::numbers::pi);
    const Eigen::Vector2d reach =
        random->Uniform(8.0, 60.0) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    frame.segments.push_back({middle - reach, middle + reach});
  }
  const Rigid3 world_from_cam = frame.cam_from_world.Inverse();
  for (uint32_t i = 0; i < num_points; ++i) {
    const Eigen::Vector2d px(random->Uniform(0, camera.width_px),
                             random->Uniform(0, camera.height_px));
    const double z = random->Uniform(1.0, 5.0);
    const Eigen::Vector3d x = z * camera.Normalize(px).homogeneous();
    const Eigen::Vector3d deviation =
        world_from_cam.rotation * (3.0 * (0.004 * z * z + 0.003) * x.normalized());
    Point point{px + noise(), world_from_cam * x + random->Normal() / 3.0 * deviation, deviation};
    if (i % 5 == 4) point.pixel += 40.0 * Eigen::Vector2d(random->Normal(), random->Normal());
    frame.points.push_back(point);
  }
  return frame;
}

}  // namespace plumb::synth
