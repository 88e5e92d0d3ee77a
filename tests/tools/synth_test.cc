// The renderer is the ground truth of other tests, so it is held to closed forms here.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "plumb/geometry/line_projection.h"
#include "tools/synth/camera_path.h"
#include "tools/synth/render.h"
#include "tools/synth/room.h"
#include "tools/synth/texture.h"

namespace plumb::synth {
namespace {

Camera SmallCamera() {
  Camera camera;
  camera.fx = camera.fy = 60.0;
  camera.width_px = 80;
  camera.height_px = 64;
  camera.cx = 39.5;
  camera.cy = 31.5;
  return camera;
}

/// A camera in the origin of the world that looks along +x, z up.
Rigid3 LookAlongX(const Eigen::Vector3d& centre) {
  Eigen::Matrix3d cam_from_world;
  cam_from_world << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  Rigid3 pose;
  pose.rotation = Eigen::Quaterniond(cam_from_world);
  pose.translation = -(pose.rotation * centre);
  return pose;
}

Scene EmptyRoom() {
  Scene scene;
  scene.room_min = Eigen::Vector3d(-2.0, -3.0, 0.0);
  scene.room_max = Eigen::Vector3d(4.0, 3.0, 2.5);
  scene.lamps.emplace_back(0.0, 0.0, 2.0);
  return scene;
}

Box UnitBox(const Eigen::Vector3d& centre) {
  Box box;
  box.centre = centre;
  return box;
}

RenderOptions Plain() {
  RenderOptions options;
  options.samples_per_axis = 1;
  options.noise_grey_levels = 0.0;
  return options;
}

TEST(Render, DepthOfAFacingWallIsItsDistanceAlongTheAxis) {
  const Camera camera = SmallCamera();
  const RgbdImage image =
      Render(EmptyRoom(), *Rectifier::Create(camera), LookAlongX({0.0, 0.0, 1.2}), Plain());
  for (int x = 0; x < camera.width_px; ++x) {
    const size_t middle_row = 31;
    EXPECT_NEAR(image.depth_m[middle_row * 80 + static_cast<size_t>(x)], 4.0, 1e-5)
        << "column " << x;
  }
}

TEST(Render, ABoxHidesTheWallBehindIt) {
  Scene scene = EmptyRoom();
  scene.groups.emplace_back();
  AddBox(UnitBox({3.0, 0.0, 1.2}), &scene.groups.back());
  const RgbdImage image =
      Render(scene, *Rectifier::Create(SmallCamera()), LookAlongX({0.0, 0.0, 1.2}), Plain());
  EXPECT_NEAR(image.depth_m[32 * 80 + 40], 2.5, 1e-5);
  EXPECT_NEAR(image.depth_m[32 * 80 + 2], 4.0, 1e-5);
}

TEST(Render, EqualInputsGiveEqualBytes) {
  const Scene scene = MakeRoom(3);
  const Rigid3 pose = MakeCameraPath(scene, 3, 1.0, 3)[1];
  RenderOptions options = Plain();
  options.noise_grey_levels = 2.0;
  const RgbdImage a = Render(scene, *Rectifier::Create(SmallCamera()), pose, options);
  const RgbdImage b = Render(scene, *Rectifier::Create(SmallCamera()), pose, options);
  EXPECT_EQ(a.bgr, b.bgr);
  EXPECT_EQ(a.depth_m, b.depth_m);
  options.noise_seed = 1;
  EXPECT_NE(Render(scene, *Rectifier::Create(SmallCamera()), pose, options).bgr, a.bgr);
}

TEST(Render, ShadowsDarkenWhatALampCannotReach) {
  Scene scene = EmptyRoom();
  scene.groups.emplace_back();
  Box board = UnitBox({1.0, 0.0, 1.0});
  board.half = Eigen::Vector3d(0.5, 0.5, 0.02);
  AddBox(board, &scene.groups.back());
  // From below the board, looking down at the floor that it shades.
  const Eigen::Matrix3d down = (Eigen::Matrix3d() << 1, 0, 0, 0, -1, 0, 0, 0, -1).finished();
  Rigid3 pose;
  pose.rotation = Eigen::Quaterniond(down);
  pose.translation = -(pose.rotation * Eigen::Vector3d(2.0, 0.0, 0.9));
  RenderOptions lit = Plain();
  lit.shadows = false;
  const RgbdImage with = Render(scene, *Rectifier::Create(SmallCamera()), pose, Plain());
  const RgbdImage without = Render(scene, *Rectifier::Create(SmallCamera()), pose, lit);
  const size_t pixel = 3 * (32 * 80 + 40);
  EXPECT_LT(with.bgr[pixel] + 20, without.bgr[pixel]);
}

TEST(VisibleParts, AFreeEdgeIsSeenWhole) {
  Scene scene = EmptyRoom();
  scene.groups.emplace_back();
  AddBox(UnitBox({3.0, 0.0, 1.2}), &scene.groups.back());
  const Rigid3 pose = LookAlongX({0.0, 0.0, 1.2});
  const Segment3 front{{2.5, -0.5, 1.7}, {2.5, 0.5, 1.7}};
  const auto parts = VisibleParts(scene, SmallCamera(), pose, front, 2.0);
  ASSERT_EQ(parts.size(), 1u);
  const auto whole = ProjectSegment(SmallCamera(), pose, front);
  ASSERT_TRUE(whole);
  EXPECT_NEAR(parts[0].Length(), whole->Length(), 1e-9);
}

TEST(VisibleParts, AnEdgeOnTheFarSideIsHidden) {
  Scene scene = EmptyRoom();
  scene.groups.emplace_back();
  AddBox(UnitBox({3.0, 0.0, 1.2}), &scene.groups.back());
  const Segment3 back{{3.5, -0.5, 1.7}, {3.5, 0.5, 1.7}};
  EXPECT_TRUE(VisibleParts(scene, SmallCamera(), LookAlongX({0.0, 0.0, 1.2}), back, 2.0).empty());
}

TEST(VisibleParts, AnEdgeBehindABoxIsCutWhereTheBoxEnds) {
  Scene scene = EmptyRoom();
  scene.groups.emplace_back();
  AddBox(UnitBox({2.5, 0.0, 1.2}), &scene.groups.back());  // covers |y| < 0.5 at x = 2 .. 3
  const Rigid3 pose = LookAlongX({0.0, 0.0, 1.2});
  const Segment3 on_wall{{4.0, -2.0, 1.2}, {4.0, 2.0, 1.2}};
  const auto parts = VisibleParts(scene, SmallCamera(), pose, on_wall, 2.0);
  ASSERT_EQ(parts.size(), 2u);
  // The box's front corner is 0.5 m off axis at 2 m: 15 px from the middle; samples are 1/64 apart.
  const double step = 60.0 / 64.0;
  EXPECT_NEAR(std::min(std::abs(parts[0].start.x() - 39.5), std::abs(parts[0].end.x() - 39.5)),
              15.0, step);
  EXPECT_NEAR(std::min(std::abs(parts[1].start.x() - 39.5), std::abs(parts[1].end.x() - 39.5)),
              15.0, step);
}

TEST(VisibleParts, NothingBehindTheCameraIsSeen) {
  const Segment3 behind{{-1.0, -1.0, 1.0}, {-1.0, 1.0, 1.0}};
  EXPECT_TRUE(
      VisibleParts(EmptyRoom(), SmallCamera(), LookAlongX({0.0, 0.0, 1.2}), behind, 1.0).empty());
}

TEST(EdgesOf, TheRoomAndEveryBoxHaveTwelve) {
  Scene scene = EmptyRoom();
  EXPECT_EQ(EdgesOf(scene).size(), 12u);
  scene.groups.emplace_back();
  Box turned = UnitBox({1.0, 1.0, 1.0});
  turned.yaw_rad = 0.4;
  AddBox(turned, &scene.groups.back());
  const std::vector<Segment3> edges = EdgesOf(scene);
  ASSERT_EQ(edges.size(), 24u);
  for (size_t i = 12; i < 24; ++i) EXPECT_NEAR(edges[i].Length(), 1.0, 1e-12);
}

TEST(MakeRoom, FurnitureStaysInTheRoomAndOutOfTheCamerasWay) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const Scene scene = MakeRoom(seed);
    ASSERT_GE(scene.groups.size(), 8u);
    EXPECT_TRUE((scene.free_space.sizes().array() > 0.0).all()) << "seed " << seed;
    for (const Group& group : scene.groups) {
      EXPECT_TRUE((group.bounds.min().array() >= scene.room_min.array() - 1e-9).all())
          << "seed " << seed;
      EXPECT_TRUE((group.bounds.max().array() <= scene.room_max.array() + 1e-9).all())
          << "seed " << seed;
      EXPECT_FALSE(group.bounds.intersects(scene.free_space)) << "seed " << seed;
    }
  }
}

TEST(MakeRoom, SeedsDiffer) {
  EXPECT_NE(MakeRoom(1).room_max, MakeRoom(2).room_max);
  EXPECT_EQ(MakeRoom(1).room_max, MakeRoom(1).room_max);
}

TEST(MakeCameraPath, StaysInTheFreeSpaceAndMovesSmoothly) {
  const Scene scene = MakeRoom(5);
  const std::vector<Rigid3> path = MakeCameraPath(scene, 61, 2.0, 5);
  ASSERT_EQ(path.size(), 61u);
  for (size_t i = 0; i < path.size(); ++i) {
    EXPECT_TRUE(scene.free_space.contains(path[i].Center()));
    if (i == 0) continue;
    const PoseDistance step = DistanceBetween(path[i], path[i - 1]);
    EXPECT_LT(step.position_m, 0.12);
    EXPECT_LT(step.rotation_rad, 0.12);
    EXPECT_GT(step.rotation_rad, 0.001);
  }
}

TEST(Displace, MovesByExactlyTheGivenAmounts) {
  Random random(4);
  const Rigid3 pose = MakeCameraPath(MakeRoom(1), 2, 1.0, 1)[1];
  for (int i = 0; i < 20; ++i) {
    const PoseDistance off = DistanceBetween(Displace(pose, 0.1, 0.035, &random), pose);
    EXPECT_NEAR(off.position_m, 0.1, 1e-12);
    EXPECT_NEAR(off.rotation_rad, 0.035, 1e-9);
  }
}

TEST(DriftingTrack, StartsAtTheTruthAndWalksAway) {
  const std::vector<Rigid3> truth = MakeCameraPath(MakeRoom(2), 200, 2.0, 2);
  Random random(1);
  const std::vector<Rigid3> track = DriftingTrack(truth, 0.005, 0.002, &random);
  ASSERT_EQ(track.size(), truth.size());
  EXPECT_LT(DistanceBetween(track[0], truth[0]).position_m, 1e-12);
  EXPECT_NEAR(
      DistanceBetween(track[1] * track[0].Inverse(), truth[1] * truth[0].Inverse()).rotation_rad,
      0.002, 1e-6);
  EXPECT_GT(DistanceBetween(track[199], truth[199]).position_m, 0.02);
}

TEST(Random, NormalDrawsHaveTheRightMoments) {
  Random random(7);
  double sum = 0.0, square = 0.0;
  const int count = 20000;
  for (int i = 0; i < count; ++i) {
    const double x = random.Normal();
    sum += x;
    square += x * x;
  }
  EXPECT_NEAR(sum / count, 0.0, 0.03);
  EXPECT_NEAR(square / count, 1.0, 0.05);
}

TEST(ColourAt, EveryPatternGivesFiniteColoursThatVary) {
  for (const Pattern pattern : {Pattern::kPlain, Pattern::kGrain, Pattern::kPlanks, Pattern::kTiles,
                                Pattern::kBricks, Pattern::kPicture, Pattern::kCloth}) {
    Material material;
    material.pattern = pattern;
    material.seed = 11;
    float low = 1e9f, high = -1e9f;
    for (int i = 0; i < 400; ++i) {
      const Eigen::Vector3f colour = ColourAt(material, -1.0 + 0.013 * i, 0.7 - 0.009 * i);
      ASSERT_TRUE(colour.allFinite());
      ASSERT_GE(colour.minCoeff(), 0.0f);
      low = std::min(low, colour.x());
      high = std::max(high, colour.x());
    }
    EXPECT_GT(high, low) << static_cast<int>(pattern);
  }
}

}  // namespace
}  // namespace plumb::synth
