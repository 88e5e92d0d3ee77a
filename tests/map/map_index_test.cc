#include "plumb/map/map_index.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <thread>

#include "plumb/geometry/line_projection.h"
#include "support/allocation_counter.h"
#include "support/random_map.h"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::MakeRandomMap;

constexpr Camera kCamera{500.0, 500.0, 319.5, 239.5, 640, 480};
constexpr double kDegree = 3.14159265358979323846 / 180.0;

std::vector<uint32_t> Visible(const MapIndex& index, const Camera& camera, const Rigid3& pose,
                              const VisibilityOptions& options) {
  std::vector<uint32_t> lines;
  index.VisibleLines(camera, pose, options, &lines);
  return lines;
}

std::vector<uint32_t> NearestByBruteForce(const LineMap& map, const Rigid3& pose, size_t count) {
  std::vector<std::pair<double, uint32_t>> ranked;
  for (uint32_t k = 0; k < map.key_frames.size(); ++k) {
    const Rigid3& key_frame = map.key_frames[k].cam_from_world;
    const double cosine = pose.RotationMatrix().row(2).dot(key_frame.RotationMatrix().row(2));
    ranked.emplace_back(
        (pose.Center() - key_frame.Center()).norm() + std::acos(std::clamp(cosine, -1.0, 1.0)), k);
  }
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(std::min(count, ranked.size()));
  std::vector<uint32_t> key_frames;
  for (const auto& [cost, k] : ranked) key_frames.push_back(k);
  return key_frames;
}

/// Literally what docs/method/association.md says.
std::vector<uint32_t> VisibleByBruteForce(const LineMap& map, const Camera& camera,
                                          const Rigid3& pose, const VisibilityOptions& options) {
  const auto near = NearestByBruteForce(map, pose, options.nearest_key_frames);
  std::vector<uint32_t> lines;
  for (uint32_t i = 0; i < map.lines.size(); ++i) {
    const MapLine& line = map.lines[i];
    if (line.num_observing < options.min_observing) continue;
    const Eigen::Vector3d ray = pose.Center() - line.segment_in_world.Midpoint();
    bool seen = false;
    for (const LineSighting& sighting : map.SightingsOf(i)) {
      const double angle = std::acos(
          std::clamp(ray.normalized().dot(sighting.direction_to_camera.cast<double>()), -1.0, 1.0));
      const double ratio = ray.norm() / static_cast<double>(sighting.distance_m);
      const bool is_near = options.nearest_key_frames == 0 ||
                           std::find(near.begin(), near.end(), sighting.key_frame) != near.end();
      seen |= is_near && angle < options.max_view_angle_rad && ratio < options.max_distance_ratio &&
              1.0 / ratio < options.max_distance_ratio;
    }
    const auto image = ProjectSegment(camera, pose, line.segment_in_world, options.margin_px);
    if (seen && image && image->Length() >= options.min_length_px) lines.push_back(i);
  }
  return lines;
}

Rigid3 RandomPose(std::mt19937* rng, const Eigen::Vector3d& center) {
  std::normal_distribution<double> normal;
  const auto vector = [&](double scale) {
    return Eigen::Vector3d(scale * normal(*rng), scale * normal(*rng), scale * normal(*rng));
  };
  const Eigen::Quaterniond rotation = ExpSo3(vector(1.5));
  return {rotation, -(rotation * (center + vector(2.0)))};
}

TEST(MapIndex, FindsWhatBruteForceFindsInThousandsOfViews) {
  std::mt19937 rng(7);
  size_t num_found = 0;
  for (const double offset : {0.0, 1.0e5}) {
    const Eigen::Vector3d center(offset, -offset, 0.0);
    const LineMap map = MakeRandomMap({400, 30, 0, 0}, /*seed=*/1, center);
    const MapIndex index(map);
    for (int trial = 0; trial < 1500; ++trial) {
      Camera camera = kCamera;
      if (trial % 5 == 1) camera.fy = -camera.fy;
      if (trial % 5 == 2) camera.cx = 900.0;  // the optical axis leaves the image
      VisibilityOptions options;
      options.margin_px = trial % 3 * 60.0;
      options.min_length_px = trial % 2 * 15.0;
      options.min_observing = static_cast<uint32_t>(trial % 4);
      options.max_view_angle_rad = (20.0 + trial % 7 * 25.0) * kDegree;
      options.max_distance_ratio = 1.2 + trial % 6;
      options.nearest_key_frames = static_cast<uint32_t>(trial % 4 == 3 ? 5 : 0);
      const Rigid3 pose = RandomPose(&rng, center);
      const auto expected = VisibleByBruteForce(map, camera, pose, options);
      ASSERT_EQ(Visible(index, camera, pose, options), expected) << "trial " << trial;
      num_found += expected.size();
    }
  }
  EXPECT_GT(num_found, 20'000u) << "The views saw too little for the comparison to mean much.";
}

TEST(MapIndex, RanksKeyFramesAsBruteForceDoes) {
  const LineMap map = MakeRandomMap({0, 300, 0, 0}, /*seed=*/2);
  const MapIndex index(map);
  std::mt19937 rng(8);
  std::vector<uint32_t> key_frames;
  for (int trial = 0; trial < 500; ++trial) {
    const Rigid3 pose = RandomPose(&rng, {0, 0, 0});
    for (const uint32_t count : {1u, 3u, 10u, 300u, 1000u}) {
      index.NearestKeyFrames(pose, count, &key_frames);
      ASSERT_EQ(key_frames, NearestByBruteForce(map, pose, count));
    }
  }
}

TEST(MapIndex, BreaksTiesBetweenKeyFramesByIndex) {
  LineMap map = MakeRandomMap({0, 1, 0, 0}, /*seed=*/3);
  map.key_frames.resize(40, map.key_frames.front());
  const MapIndex index(map);
  std::vector<uint32_t> key_frames;
  index.NearestKeyFrames(map.key_frames.front().cam_from_world, 4, &key_frames);
  EXPECT_THAT(key_frames, ElementsAre(0u, 1u, 2u, 3u));
}

TEST(MapIndex, RanksARotationOfOneRadianLikeOneMetre) {
  LineMap map = MakeRandomMap({0, 2, 0, 0}, /*seed=*/4);
  map.key_frames[0].cam_from_world = {Eigen::Quaterniond::Identity(), {0.9, 0.0, 0.0}};
  map.key_frames[1].cam_from_world = {ExpSo3({0.8, 0.0, 0.0}), Eigen::Vector3d::Zero()};
  const MapIndex index(map);
  std::vector<uint32_t> key_frames;
  index.NearestKeyFrames({}, 2, &key_frames);
  EXPECT_THAT(key_frames, ElementsAre(1u, 0u));
  // A roll about the optical axis costs nothing.
  map.key_frames[0].cam_from_world = {ExpSo3({0.0, 0.0, 2.0}), {0.5, 0.0, 0.0}};
  const MapIndex rolled(map);
  rolled.NearestKeyFrames({}, 2, &key_frames);
  EXPECT_THAT(key_frames, ElementsAre(0u, 1u));
}

TEST(MapIndex, TellsTheVisibleLengthsOfTheSameLines) {
  const LineMap map = MakeRandomMap({300, 12, 0, 0}, /*seed=*/6);
  const MapIndex index(map);
  std::vector<uint32_t> ids;
  std::vector<VisibleLine> visible;
  size_t num_visible = 0;
  for (int k = 0; k < 50; ++k) {
    const Rigid3 pose = map.key_frames[static_cast<size_t>(k) % 12].cam_from_world;
    VisibilityOptions options;
    options.nearest_key_frames = k % 2 == 0 ? 0 : 4;
    index.VisibleLines(kCamera, pose, options, &ids);
    index.VisibleLines(kCamera, pose, options, &visible);
    std::sort(visible.begin(), visible.end(),
              [](const VisibleLine& a, const VisibleLine& b) { return a.line < b.line; });
    ASSERT_EQ(visible.size(), ids.size());
    for (size_t i = 0; i < ids.size(); ++i) {
      EXPECT_EQ(visible[i].line, ids[i]);
      const auto image =
          ProjectSegment(kCamera, pose, map.lines[ids[i]].segment_in_world, options.margin_px);
      ASSERT_TRUE(image);
      EXPECT_NEAR(visible[i].length_px, image->Length(), 1e-2);
    }
    num_visible += ids.size();
  }
  EXPECT_GT(num_visible, 500u);
}

TEST(MapIndex, OfAnEmptyMapFindsNothing) {
  const LineMap map;
  const MapIndex index(map);
  std::vector<uint32_t> out = {7};
  index.VisibleLines(kCamera, Rigid3{}, VisibilityOptions{}, &out);
  EXPECT_THAT(out, IsEmpty());
  out = {7};
  index.NearestKeyFrames({}, 5, &out);
  EXPECT_THAT(out, IsEmpty());
}

/// One line across the optical axis, 4 m in front of the world's origin, seen from there.
class OneLineTest : public ::testing::Test {
 protected:
  OneLineTest() {
    map_.key_frames.resize(2);
    map_.lines.resize(1);
    map_.lines[0].segment_in_world = {{-0.5, 0.0, 4.0}, {0.5, 0.0, 4.0}};
    map_.lines[0].num_observing = map_.lines[0].num_expected = 2;
    map_.sightings = {{0, {0.0f, 0.0f, -1.0f}, 4.0f}};
    map_.sighting_begin = {0, 1};
  }
  bool IsVisibleFrom(const Eigen::Vector3d& center, const Eigen::Vector3d& rotation = {0, 0, 0}) {
    const Eigen::Quaterniond q = ExpSo3(rotation);
    return !Visible(MapIndex(map_), kCamera, {q, -(q * center)}, options_).empty();
  }

  LineMap map_;
  VisibilityOptions options_;
};

TEST_F(OneLineTest, IsVisibleFromWhereItWasSeen) { EXPECT_TRUE(IsVisibleFrom({0, 0, 0})); }

TEST_F(OneLineTest, IsNotVisibleFromBehind) {
  EXPECT_FALSE(IsVisibleFrom({0, 0, 8}, {0, 180.0 * kDegree, 0}));  // looks back at it
  options_.max_view_angle_rad = 181.0 * kDegree;
  EXPECT_TRUE(IsVisibleFrom({0, 0, 8}, {0, 180.0 * kDegree, 0}));
}

TEST_F(OneLineTest, IsNotVisibleWhenTheCameraLooksAway) {
  EXPECT_FALSE(IsVisibleFrom({0, 0, 0}, {0, 90.0 * kDegree, 0}));
  EXPECT_FALSE(IsVisibleFrom({0, 0, 0}, {0, 180.0 * kDegree, 0}));
}

TEST_F(OneLineTest, IsVisibleUpTo40DegreesFromTheViewThatSawIt) {
  const auto from_angle = [&](double degrees) {
    const double angle = degrees * kDegree;
    const Eigen::Vector3d center(4.0 * std::sin(angle), 0.0, 4.0 - 4.0 * std::cos(angle));
    return IsVisibleFrom(center, {0, angle, 0});
  };
  EXPECT_TRUE(from_angle(39.5));
  EXPECT_FALSE(from_angle(40.5));
}

TEST_F(OneLineTest, IsVisibleFromHalfToTwiceTheDistance) {
  EXPECT_FALSE(IsVisibleFrom({0, 0, 2.01}));
  EXPECT_TRUE(IsVisibleFrom({0, 0, 1.99}));
  EXPECT_TRUE(IsVisibleFrom({0, 0, -3.99}));
  EXPECT_FALSE(IsVisibleFrom({0, 0, -4.01}));
}

TEST_F(OneLineTest, IsNotVisibleWhenTooShortInTheImage) {
  options_.min_length_px = 124.9;  // 500 px * 1 m / 4 m = 125 px
  EXPECT_TRUE(IsVisibleFrom({0, 0, 0}));
  options_.min_length_px = 125.1;
  EXPECT_FALSE(IsVisibleFrom({0, 0, 0}));
}

TEST_F(OneLineTest, CountsOnlyThePartInsideTheEnlargedImage) {
  // Moved 320 px to the left: the border at x = 0 plus the margin cuts it at its middle.
  options_.margin_px = 0.0;
  options_.min_length_px = 63.0;
  EXPECT_FALSE(IsVisibleFrom({2.56, 0, 0}));
  options_.margin_px = 1.0;
  EXPECT_TRUE(IsVisibleFrom({2.55, 0, 0}));
}

TEST_F(OneLineTest, NeedsEnoughObservations) {
  options_.min_observing = 3;
  EXPECT_FALSE(IsVisibleFrom({0, 0, 0}));
  options_.min_observing = 0;
  EXPECT_TRUE(IsVisibleFrom({0, 0, 0}));
}

TEST_F(OneLineTest, NeedsASightingByANearKeyFrameWhenAskedFor) {
  map_.key_frames[0].cam_from_world.translation.x() = -1.0;  // the one that saw it: second nearest
  options_.nearest_key_frames = 1;
  EXPECT_FALSE(IsVisibleFrom({0, 0, 0}));
  options_.nearest_key_frames = 2;
  EXPECT_TRUE(IsVisibleFrom({0, 0, 0}));
}

TEST_F(OneLineTest, IsNotVisibleWithoutSightings) {
  map_.sightings.clear();
  map_.sighting_begin = {0, 0};
  EXPECT_FALSE(IsVisibleFrom({0, 0, 0}));
}

TEST_F(OneLineTest, IsVisibleWhenBothEndPointsAreOutsideTheImage) {
  map_.lines[0].segment_in_world = {{-40.0, 0.3, 4.0}, {40.0, 0.3, 4.0}};
  EXPECT_TRUE(IsVisibleFrom({0, 0, 0}));
}

TEST_F(OneLineTest, IsVisibleWhenItPassesBesideTheCameraToItsBack) {
  map_.lines[0].segment_in_world = {{0.4, 0.3, 9.0}, {0.4, 0.3, -1.0}};
  map_.sightings[0].direction_to_camera = Eigen::Vector3f(-0.4f, -0.3f, -4.0f).normalized();
  EXPECT_TRUE(IsVisibleFrom({0, 0, 0}));
}

TEST_F(OneLineTest, IsNotVisibleFromItsOwnMidpoint) { EXPECT_FALSE(IsVisibleFrom({0, 0, 4})); }

TEST_F(OneLineTest, IsNotVisibleFromAPoseOrCameraThatIsNotFinite) {
  const MapIndex index(map_);
  Rigid3 pose;
  pose.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Visible(index, kCamera, pose, {}), IsEmpty());
  Camera camera = kCamera;
  camera.fx = std::numeric_limits<double>::infinity();
  EXPECT_THAT(Visible(index, camera, {}, {}), IsEmpty());
  std::vector<uint32_t> key_frames = {7};
  index.NearestKeyFrames(pose, 1, &key_frames);
  EXPECT_THAT(key_frames, IsEmpty());
}

TEST(MapIndex, DoesNotAllocateOnceWarm) {
  const LineMap map = MakeRandomMap({400, 30, 0, 0}, /*seed=*/5);
  const MapIndex index(map);
  std::vector<uint32_t> lines, key_frames;
  lines.reserve(map.lines.size());
  key_frames.reserve(10);
  VisibilityOptions options;
  options.nearest_key_frames = 5;
  std::mt19937 rng(9);
  index.VisibleLines(kCamera, RandomPose(&rng, {0, 0, 0}), options, &lines);
  index.NearestKeyFrames(RandomPose(&rng, {0, 0, 0}), 10, &key_frames);
  const size_t before = testing::num_allocations;
  for (int trial = 0; trial < 100; ++trial) {
    index.VisibleLines(kCamera, RandomPose(&rng, {0, 0, 0}), options, &lines);
    index.NearestKeyFrames(RandomPose(&rng, {0, 0, 0}), 10, &key_frames);
  }
  EXPECT_EQ(testing::num_allocations, before);
}

TEST(MapIndex, AnswersSeveralThreadsAtOnce) {
  const LineMap map = MakeRandomMap({400, 30, 0, 0}, /*seed=*/6);
  const MapIndex index(map);
  VisibilityOptions options;
  options.nearest_key_frames = 5;
  const auto run = [&](std::vector<std::vector<uint32_t>>* out) {
    std::mt19937 rng(10);
    for (int trial = 0; trial < 200; ++trial) {
      out->push_back(Visible(index, kCamera, RandomPose(&rng, {0, 0, 0}), options));
    }
  };
  std::vector<std::vector<uint32_t>> results[4];
  std::vector<std::thread> threads;
  for (auto& result : results) threads.emplace_back(run, &result);
  for (std::thread& thread : threads) thread.join();
  for (const auto& result : results) EXPECT_EQ(result, results[0]);
}

TEST(MapIndex, KeepsAnsweringAfterItWasMoved) {
  const LineMap map = MakeRandomMap({50, 5, 0, 0}, /*seed=*/7);
  MapIndex first(map);
  const Rigid3 pose = map.key_frames[0].cam_from_world;
  const auto before = Visible(first, kCamera, pose, {});
  const MapIndex second(std::move(first));
  EXPECT_EQ(Visible(second, kCamera, pose, {}), before);
  EXPECT_EQ(&second.map(), &map);
}

}  // namespace
}  // namespace plumb
