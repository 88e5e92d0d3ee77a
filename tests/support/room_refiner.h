// A refiner over the synthetic room, and what the tests of refined poses ask it.
#pragma once

#include <cmath>
#include <cstring>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/map/map_index.h"
#include "plumb/runtime/pose_refiner.h"
#include "support/synthetic_room.h"

namespace plumb::testing {

inline constexpr double kDegree = std::numbers::pi / 180.0;

/// Lines, the map that key frames give of them, and a refiner.
struct RoomRefiner {
  explicit RoomRefiner(std::vector<Segment3> segments, const PoseRefinerOptions& options = {},
                       const std::vector<Rigid3>& key_frames = RoomKeyFrames())
      : lines(std::move(segments)),
        map(MapOf(lines, key_frames)),
        index(map),
        refiner(std::move(*PoseRefiner::Create(index, options))) {}

  RefineResult Refine(const RefineInput& input) {
    RefineResult result;
    const Status status = refiner->Refine(input, &result);
    EXPECT_TRUE(status) << (status ? "" : status.error().message);
    return result;
  }

  std::vector<Segment3> lines;
  LineMap map;
  MapIndex index;
  std::unique_ptr<PoseRefiner> refiner;
};

inline RefineInput InputOf(const std::vector<Segment2>& segments, const Rigid3& prior,
                           double position_sigma_m = 0.10,
                           double rotation_sigma_rad = 2.0 * kDegree) {
  RefineInput input;
  input.camera = RoomCamera();
  input.segments = segments;
  input.prior = {prior, position_sigma_m, rotation_sigma_rad};
  return input;
}

/// A pose between the key frames.
inline Rigid3 QueryPose(int k) {
  return LookAlong({-1.2 + 0.27 * k, 0.4 - 0.1 * k, 0.15},
                   {std::cos(0.6 * k), std::sin(0.6 * k), -0.15});
}

/// Image points of random places in front of the camera.
inline std::vector<PointMatch> RenderPoints(const Rigid3& pose, size_t count, double outlier_share,
                                            uint64_t seed) {
  Random random(seed);
  const Camera camera = RoomCamera();
  std::vector<PointMatch> points;
  while (points.size() < count) {
    const Eigen::Vector3d x(UniformIn(&random, -1.5, 1.5), UniformIn(&random, -1.2, 1.2),
                            UniformIn(&random, 1.5, 4.0));
    if (!camera.Contains(camera.Project(x))) continue;
    PointMatch& match = points.emplace_back();
    match.pixel = camera.Project(x) + 0.5 * random.Normal3(1.0f).head<2>().cast<double>();
    match.point_in_world = pose.Inverse() * x;
    if (random.Uniform() < outlier_share) match.pixel.x() += UniformIn(&random, 15, 90);
  }
  return points;
}

inline bool HaveSameBits(const Rigid3& a, const Rigid3& b) {
  return std::memcmp(a.rotation.coeffs().data(), b.rotation.coeffs().data(), 4 * sizeof(double)) ==
             0 &&
         std::memcmp(a.translation.data(), b.translation.data(), 3 * sizeof(double)) == 0;
}

}  // namespace plumb::testing
