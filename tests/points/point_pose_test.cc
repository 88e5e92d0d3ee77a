#include "plumb/points/point_pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "plumb/points/point_lifting.h"
#include "support/textured_corner.h"

namespace plumb {
namespace {

using testing::RenderedView;
using testing::TexturedCorner;

constexpr Camera kCamera{260.0, 260.0, 159.5, 119.5, 320, 240};

Rigid3 PoseAt(const Eigen::Vector3d& center, const Eigen::Vector3d& rotation) {
  const Eigen::Quaterniond q = ExpSo3(rotation);
  return {q, -(q * center)};
}

/// Noise-free matches of random points in front of a camera.
std::vector<PointCorrespondence> MakeMatches(const Camera& camera, const Rigid3& cam_from_world,
                                             size_t count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> x(0.0, camera.width_px - 1), y(0.0, camera.height_px - 1),
      z(1.0, 4.0);
  std::vector<PointCorrespondence> matches(count);
  for (auto& match : matches) {
    match.pixel = {x(rng), y(rng)};
    const Eigen::Vector3d ray = camera.Normalize(match.pixel).homogeneous();
    match.point_in_world = cam_from_world.Inverse() * (z(rng) * ray);
  }
  return matches;
}

TEST(DeviationAlongRay, PointsFromTheKeyFrameToThePoint) {
  const Rigid3 pose = PoseAt({1.0, 2.0, 3.0}, {0.1, 0.2, 0.3});
  const Eigen::Vector3d in_cam(0.5, -0.25, 2.0);
  const Eigen::Vector3d deviation = DeviationAlongRay(pose, pose.Inverse() * in_cam, {}, 3.0);
  // 3 * (0.004 * 4 + 0.003) along (0.25, -0.125, 1).
  EXPECT_TRUE(
      (pose.rotation * deviation).isApprox(0.057 * Eigen::Vector3d(0.25, -0.125, 1.0), 1e-12));
}

TEST(DeviationAlongRay, IsZeroBehindTheKeyFrame) {
  EXPECT_EQ(DeviationAlongRay({}, {0.0, 0.0, -1.0}, {}, 3.0), Eigen::Vector3d::Zero());
}

TEST(EstimatePointPose, FindsThePoseOfPerfectMatches) {
  const Rigid3 truth = PoseAt({0.3, -0.5, 0.2}, {0.2, -0.4, 1.0});
  const auto pose = EstimatePointPose(kCamera, MakeMatches(kCamera, truth, 40, /*seed=*/1));
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->inliers.size(), 40u);
  const PoseDistance error = DistanceBetween(pose->cam_from_world, truth);
  EXPECT_LT(error.position_m, 1e-6);
  EXPECT_LT(error.rotation_rad, 1e-6);
}

TEST(EstimatePointPose, WorksForAMirroredCamera) {
  Camera camera = kCamera;
  camera.fy = -camera.fy;
  const Rigid3 truth = PoseAt({0.3, -0.5, 0.2}, {0.2, -0.4, 1.0});
  const auto pose = EstimatePointPose(camera, MakeMatches(camera, truth, 40, /*seed=*/2));
  ASSERT_TRUE(pose);
  EXPECT_LT(DistanceBetween(pose->cam_from_world, truth).position_m, 1e-6);
}

TEST(EstimatePointPose, TellsWrongMatchesFromRightOnes) {
  const Rigid3 truth = PoseAt({0.3, -0.5, 0.2}, {0.2, -0.4, 1.0});
  auto matches = MakeMatches(kCamera, truth, 100, /*seed=*/3);
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> x(0.0, 319.0), y(0.0, 239.0);
  for (size_t i = 0; i < 50; ++i) matches[i].pixel = {x(rng), y(rng)};  // half are wrong
  const auto pose = EstimatePointPose(kCamera, matches);
  ASSERT_TRUE(pose);
  EXPECT_LT(DistanceBetween(pose->cam_from_world, truth).position_m, 1e-3);
  size_t num_right = 0;
  for (const uint32_t i : pose->inliers) num_right += i >= 50;
  EXPECT_EQ(num_right, 50u);
  EXPECT_LT(pose->inliers.size(), 53u);
}

TEST(EstimatePointPose, HasNoAnswerWithoutConsensus) {
  const Rigid3 truth = PoseAt({0.0, 0.0, 0.0}, {0.0, 0.0, 0.0});
  EXPECT_FALSE(EstimatePointPose(kCamera, {}));
  EXPECT_FALSE(EstimatePointPose(kCamera, MakeMatches(kCamera, truth, 5, /*seed=*/5)));
  auto matches = MakeMatches(kCamera, truth, 30, /*seed=*/6);
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> x(0.0, 319.0), y(0.0, 239.0);
  for (auto& match : matches) match.pixel = {x(rng), y(rng)};
  EXPECT_FALSE(EstimatePointPose(kCamera, matches, {.min_inliers = 12}));
}

TEST(EstimatePointPose, SurvivesPointsThatAllCoincide) {
  std::vector<PointCorrespondence> matches(20);
  for (auto& match : matches) {
    match.pixel = {100.0, 100.0};
    match.point_in_world = {1.0, 2.0, 3.0};
  }
  const auto pose = EstimatePointPose(kCamera, matches);
  EXPECT_TRUE(!pose || pose->cam_from_world.IsFinite());
}

TEST(RefinePointPose, TrustsPointsWithSmallDepthDeviationMore) {
  // Two of three points are off along the rays of a key frame 2 m to the right, by 5 to 8 px here.
  const Rigid3 truth = PoseAt({0, 0, 0}, {0, 0, 0}), key_frame = PoseAt({2.0, 0, 0}, {0, 0, 0});
  double sum = 0.0, ignorant_sum = 0.0;
  for (unsigned seed = 10; seed < 30; ++seed) {
    std::mt19937 rng(seed);
    std::normal_distribution<double> normal;
    auto matches = MakeMatches(kCamera, truth, 60, seed);
    for (size_t i = 0; i < matches.size(); ++i) {
      const Eigen::Vector3d x = matches[i].point_in_world;
      const double sigma_m = i % 3 == 0 ? 0.001 : 0.05;
      matches[i].deviation_in_world = sigma_m * (x - key_frame.Center()) / (key_frame * x).z();
      matches[i].point_in_world += normal(rng) * matches[i].deviation_in_world;
      matches[i].pixel += 0.3 * Eigen::Vector2d(normal(rng), normal(rng));
    }
    auto ignorant = matches;
    for (auto& match : ignorant) match.deviation_in_world.setZero();
    const auto error = [&](const std::vector<PointCorrespondence>& given) {
      return DistanceBetween(RefinePointPose(kCamera, given, 0.7, truth), truth).position_m;
    };
    sum += error(matches);
    ignorant_sum += error(ignorant);
  }
  EXPECT_LT(sum, 0.5 * ignorant_sum);
}

TEST(RefinePointPose, IgnoresPointsBehindTheCamera) {
  const Rigid3 truth = PoseAt({0.1, 0.0, 0.0}, {0.0, 0.1, 0.0});
  auto matches = MakeMatches(kCamera, truth, 30, /*seed=*/9);
  matches[0].point_in_world = truth.Inverse() * Eigen::Vector3d(0.0, 0.0, -2.0);
  const Rigid3 start = PoseAt({0.12, 0.01, 0.0}, {0.0, 0.11, 0.0});
  EXPECT_LT(DistanceBetween(RefinePointPose(kCamera, matches, 0.7, start), truth).position_m, 1e-6);
  EXPECT_EQ(RefinePointPose(kCamera, {matches.data(), 1}, 0.7, start).translation,
            start.translation);
}

/// A map of two views of a textured wall and floor, and a third view that is to be found.
class RenderedPointsTest : public ::testing::Test {
 protected:
  struct Scene {
    LineMap map;
    ImagePoints query;
    Rigid3 truth;
  };
  static Scene MakeScene() {
    Scene made;
    const TexturedCorner corner(5);
    PointExtractor extractor;
    const auto extract = [&](const RenderedView& view, ImagePoints* points) {
      EXPECT_TRUE(extractor.Extract(
          {view.gray.data(), kCamera.width_px, kCamera.width_px, kCamera.height_px}, points));
    };
    for (const double x : {-0.2, 0.2}) {
      const RenderedView view = corner.Render(kCamera, PoseAt({x, 0.0, 0.0}, {-0.1, x, 0.0}));
      ImagePoints points;
      extract(view, &points);
      KeyFrame key_frame;
      key_frame.cam_from_world = view.cam_from_world;
      key_frame.camera = kCamera;
      key_frame.points =
          LiftPoints(points, *Rectifier::Create(kCamera), view.cam_from_world,
                     {DepthFormat::kFloat, view.depth_m.data(), 4LL * kCamera.width_px,
                      kCamera.width_px, kCamera.height_px, 1.0});
      made.map.key_frames.push_back(std::move(key_frame));
    }
    made.truth = PoseAt({0.05, -0.05, 0.25}, {-0.05, 0.05, 0.1});
    extract(corner.Render(kCamera, made.truth), &made.query);
    return made;
  }

  RenderedPointsTest() {
    static const Scene scene = MakeScene();  // once for all tests
    map_ = scene.map;
    query_ = scene.query;
    truth_ = prior_ = scene.truth;
    prior_.translation.x() += 0.1;
  }

  std::vector<PointCorrespondence> Match(const PointMatcherOptions& options = {}) {
    std::vector<PointCorrespondence> matches;
    PointMatcher(options).Match(query_, MapIndex(map_), {&prior_, 1}, &matches);
    return matches;
  }
  double ErrorPx(const PointCorrespondence& match) const {
    return (kCamera.Project(truth_ * match.point_in_world) - match.pixel).norm();
  }

  LineMap map_;
  ImagePoints query_;
  Rigid3 truth_, prior_;
};

TEST_F(RenderedPointsTest, MostMatchesFitTheTruePose) {
  const auto matches = Match();
  EXPECT_GT(matches.size(), 150u);
  size_t num_right = 0;
  for (const auto& match : matches) num_right += ErrorPx(match) < 2.0;
  EXPECT_GT(num_right, matches.size() * 85 / 100);
}

TEST_F(RenderedPointsTest, MatchesNameTheirPoints) {
  for (const PointCorrespondence& match : Match()) {
    const KeyFrame& key_frame = map_.key_frames.at(match.key_frame);
    const MapPoint& point = key_frame.points.at(match.map_point);
    ASSERT_EQ(match.point_in_world, point.point_in_world.cast<double>());
    ASSERT_EQ(match.pixel, query_.pixels.at(match.image_point).cast<double>());
    ASSERT_TRUE(match.deviation_in_world.isApprox(
        DeviationAlongRay(key_frame.cam_from_world, match.point_in_world, {}, 3.0)));
  }
}

TEST_F(RenderedPointsTest, OnlyTheNearestKeyFramesAreMatched) {
  PointMatcherOptions options;
  options.num_key_frames = 1;
  const auto matches = Match(options);
  ASSERT_FALSE(matches.empty());
  std::vector<uint32_t> key_frames;
  MapIndex(map_).NearestKeyFrames(prior_, 1, &key_frames);
  for (const auto& match : matches) EXPECT_EQ(match.key_frame, key_frames[0]);
  EXPECT_LT(matches.size(), Match().size());
}

TEST_F(RenderedPointsTest, TheKeyFramesOfSeveralPriorsAreMatchedOnce) {
  PointMatcherOptions options;
  options.num_key_frames = 1;
  // The places of all key frames, each of them twice.
  std::vector<Rigid3> priors;
  for (int round = 0; round < 2; ++round) {
    for (const KeyFrame& key_frame : map_.key_frames) priors.push_back(key_frame.cam_from_world);
  }
  std::vector<PointCorrespondence> matches;
  PointMatcher(options).Match(query_, MapIndex(map_), priors, &matches);
  std::set<uint32_t> key_frames;
  std::set<std::pair<uint32_t, uint32_t>> distinct;
  for (const auto& match : matches) {
    key_frames.insert(match.key_frame);
    distinct.emplace(match.key_frame, match.map_point);
  }
  EXPECT_GT(key_frames.size(), 1u);
  EXPECT_EQ(distinct.size(), matches.size());
}

TEST_F(RenderedPointsTest, GiveThePoseWithinMillimetres) {
  const auto matches = Match();
  const auto pose = EstimatePointPose(kCamera, matches);
  ASSERT_TRUE(pose);
  const PoseDistance error = DistanceBetween(pose->cam_from_world, truth_);
  EXPECT_LT(error.position_m, 0.006);
  EXPECT_LT(error.rotation_rad, 0.002);
  EXPECT_GT(pose->inliers.size(), matches.size() * 7 / 10);
}

TEST_F(RenderedPointsTest, AreTheSameEveryTime) {
  const auto first = Match(), second = Match();
  ASSERT_EQ(first.size(), second.size());
  for (size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].image_point, second[i].image_point);
    EXPECT_EQ(first[i].map_point, second[i].map_point);
  }
  EXPECT_EQ(EstimatePointPose(kCamera, first)->cam_from_world.translation,
            EstimatePointPose(kCamera, second)->cam_from_world.translation);
}

TEST_F(RenderedPointsTest, AnImageOrMapWithoutPointsMatchesNothing) {
  std::vector<PointCorrespondence> matches(3);
  PointMatcher().Match({}, MapIndex(map_), {&prior_, 1}, &matches);
  EXPECT_TRUE(matches.empty());
  const LineMap empty;
  matches.resize(3);
  PointMatcher().Match(query_, MapIndex(empty), {&prior_, 1}, &matches);
  EXPECT_TRUE(matches.empty());
}

}  // namespace
}  // namespace plumb
