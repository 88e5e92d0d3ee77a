#include "plumb/search/pose_search.h"

#include <cmath>
#include <cstring>
#include <numbers>

#include <gtest/gtest.h>

#include "support/synthetic_room.h"

namespace plumb {
namespace {

using testing::Disturb;
using testing::LookAlong;

constexpr double kDegree = std::numbers::pi / 180.0;

std::vector<SearchLine> RoomSearchLines() {
  std::vector<SearchLine> lines;
  for (const Segment3& line : testing::RoomLines()) lines.push_back({line, 1.0});
  return lines;
}

Rigid3 QueryPose(int k) {
  return LookAlong({-1.0 + 0.4 * k, 0.5 - 0.3 * k, 0.1},
                   {std::cos(1.1 * k), std::sin(1.1 * k), -0.1});
}

TEST(DirectionClusters, FindTheAxesOfTheRoom) {
  DirectionClusterer clusterer;
  std::vector<DirectionCluster> clusters;
  clusterer.Cluster(RoomSearchLines(), 12, &clusters);
  ASSERT_GE(clusters.size(), 3u);
  EXPECT_FLOAT_EQ(clusters[0].weight, 1.0f);
  Eigen::Vector3f found = Eigen::Vector3f::Zero();
  for (int i = 0; i < 3; ++i) found += clusters[i].direction.cwiseAbs();
  EXPECT_LT((found - Eigen::Vector3f::Ones()).norm(), 0.05f);  // one of each axis
  for (size_t i = 1; i < clusters.size(); ++i) EXPECT_LE(clusters[i].weight, clusters[0].weight);
}

TEST(DirectionClusters, NothingOutOfNothing) {
  DirectionClusterer clusterer;
  std::vector<DirectionCluster> clusters(3);
  clusterer.Cluster({}, 12, &clusters);
  EXPECT_TRUE(clusters.empty());
}

TEST(RotationSearch, KeepsTheRotationWhateverThePosition) {
  const Camera camera = testing::RoomCamera();
  DirectionClusterer clusterer;
  RotationSearch search;
  Random random(1), noise(2);
  for (int k = 0; k < 4; ++k) {
    const Rigid3 truth = QueryPose(k);
    const Rigid3 prior = Disturb(truth, 0.8, 6.0 * kDegree, &noise);
    std::vector<SearchLine> in_prior;
    for (const Segment3& line : testing::RoomLines()) {
      in_prior.push_back({{prior * line.start, prior * line.end}, 1.0});
    }
    std::vector<DirectionCluster> clusters;
    clusterer.Cluster(in_prior, 12, &clusters);
    std::vector<Eigen::Matrix3f> rotations;
    search.Search(camera, testing::Render(testing::RoomLines(), truth, 10 + k), clusters,
                  {.num_draws = 1500,
                   .num_kept = 24,
                   .spread = {.sigma_rad = static_cast<float>(8.0 * kDegree / std::sqrt(3.0))}},
                  &random, &rotations);
    ASSERT_EQ(rotations.size(), 24u);
    double nearest = 10.0;
    for (const Eigen::Matrix3f& rotation : rotations) {
      const Eigen::Matrix3d found = rotation.cast<double>() * prior.RotationMatrix();
      const double error = Eigen::AngleAxisd(found * truth.RotationMatrix().transpose()).angle();
      nearest = std::min(nearest, error);
    }
    EXPECT_LT(nearest, 1.5 * kDegree) << "query " << k;
  }
}

TEST(PoseSearch, FindsThePoseFromTwentyCentimetresAndFourDegrees) {
  PoseSearch search;
  Random random(3);
  const auto lines = RoomSearchLines();
  for (int k = 0; k < 6; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = testing::Render(testing::RoomLines(), truth, 20 + k);
    const Rigid3 prior = Disturb(truth, 0.20, 4.0 * kDegree, &random);
    search.SetImage(testing::RoomCamera(), segments);
    const auto found = search.Search({prior, 4.0 * kDegree, 0.20}, lines, {}, k);
    ASSERT_FALSE(found.empty());
    const PoseDistance error = DistanceBetween(found[0].cam_from_world, truth);
    // Near enough for the matching's first gate of 24 px.
    EXPECT_LT(error.position_m, 0.06) << "query " << k;
    EXPECT_LT(error.rotation_rad, 1.4 * kDegree) << "query " << k;
  }
}

TEST(PoseSearch, FewStartsFindThePoseFromTenCentimetresAndTwoDegrees) {
  PoseSearch search;
  Random random(5);
  const auto lines = RoomSearchLines();
  for (int k = 0; k < 6; ++k) {
    const Rigid3 truth = QueryPose(k);
    const auto segments = testing::Render(testing::RoomLines(), truth, 40 + k);
    const Rigid3 prior = Disturb(truth, 0.10, 2.0 * kDegree, &random);
    search.SetImage(testing::RoomCamera(), segments);
    const auto found = search.Search(
        {prior, 2.0 * kDegree, 0.10}, lines,
        {.num_hypotheses = 500, .num_aligned = 12, .num_wide = 0, .num_survivors = 1}, k);
    ASSERT_EQ(found.size(), 1u);
    const PoseDistance error = DistanceBetween(found[0].cam_from_world, truth);
    EXPECT_LT(error.position_m, 0.06) << "query " << k;
    EXPECT_LT(error.rotation_rad, 1.4 * kDegree) << "query " << k;
  }
}

TEST(PoseSearch, WithoutAlignedStartsThePriorIsLeft) {
  PoseSearch search;
  const auto lines = RoomSearchLines();
  const Rigid3 truth = QueryPose(1);
  const auto segments = testing::Render(testing::RoomLines(), truth, 3);
  search.SetImage(testing::RoomCamera(), segments);
  const auto found =
      search.Search({truth, 0.01, 0.03}, lines, {.num_hypotheses = 100, .num_aligned = 0}, 0);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT(DistanceBetween(found[0].cam_from_world, truth).position_m, 0.03);
}

TEST(PoseSearch, SurvivorsAreDistinctBestFirstAndBounded) {
  PoseSearch search;
  const Rigid3 truth = LookAlong({0.5, 0.05, 0.02}, {1.0, 0.05, 0.03});
  std::vector<SearchLine> lines;
  for (const Segment3& line : testing::FenceLines(0.2)) lines.push_back({line, 1.0});
  const auto segments = testing::Render(testing::FenceLines(0.2), truth, 1);
  search.SetImage(testing::RoomCamera(), segments);
  const auto found = search.Search({truth, 2.0 * kDegree, 0.3}, lines, {.num_survivors = 3}, 5);
  ASSERT_LE(found.size(), 3u);
  ASSERT_GE(found.size(), 2u);  // a fence looks alike in many places
  for (size_t i = 1; i < found.size(); ++i) {
    EXPECT_LE(found[i].score, found[i - 1].score);
    for (size_t j = 0; j < i; ++j) {
      const PoseDistance d = DistanceBetween(found[i].cam_from_world, found[j].cam_from_world);
      EXPECT_TRUE(d.position_m > 0.02 || d.rotation_rad > 0.01);
    }
  }
}

TEST(PoseSearch, EqualSeedsGiveEqualBits) {
  PoseSearch a, b;
  const auto lines = RoomSearchLines();
  const auto segments = testing::Render(testing::RoomLines(), QueryPose(1), 2);
  const SearchRegion region{QueryPose(1), 8.0 * kDegree, 0.4};
  a.SetImage(testing::RoomCamera(), segments);
  b.SetImage(testing::RoomCamera(), segments);
  a.Search({QueryPose(2), 0.1, 0.1}, lines, {}, 1);  // Leaves the image as it is.
  const auto x = a.Search(region, lines, {}, 9);
  const auto y = b.Search(region, lines, {}, 9);
  ASSERT_EQ(x.size(), y.size());
  for (size_t i = 0; i < x.size(); ++i) {
    EXPECT_EQ(x[i].score, y[i].score);
    EXPECT_EQ(x[i].cam_from_world.translation, y[i].cam_from_world.translation);
    EXPECT_EQ(x[i].cam_from_world.rotation.coeffs(), y[i].cam_from_world.rotation.coeffs());
  }
}

TEST(RotationSpread, GravityLeavesTheTurnAboutIt) {
  const Eigen::Vector3f axis = Eigen::Vector3f(2.0f, 3.0f, 6.0f) / 7.0f;
  const RotationSpread spread{.sigma_rad = 0.1f, .axis = axis, .tilt_sigma_rad = 0.01f};
  Random random(1);
  double about = 0.0, across = 0.0;
  constexpr int kDraws = 4000;
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector3f w = Draw(spread, &random);
    about += std::pow(w.dot(axis), 2) / kDraws;
    across += (w - w.dot(axis) * axis).squaredNorm() / kDraws;
  }
  EXPECT_NEAR(std::sqrt(about), 0.1, 0.005);
  EXPECT_NEAR(std::sqrt(across / 2.0), 0.01, 0.0005);
}

TEST(PoseSearch, NothingIsFoundWithoutLinesOrSegments) {
  PoseSearch search;
  const auto lines = RoomSearchLines();
  const auto segments = testing::Render(testing::RoomLines(), QueryPose(0), 2);
  const SearchRegion region{QueryPose(0), 0.03, 0.1};
  EXPECT_TRUE(search.Search(region, lines, {}, 0).empty()) << "There is no image yet.";
  search.SetImage(testing::RoomCamera(), segments);
  EXPECT_TRUE(search.Search(region, {}, {}, 0).empty());
  EXPECT_FALSE(search.Search(region, lines, {}, 0).empty());
  search.SetImage(testing::RoomCamera(), {});
  EXPECT_TRUE(search.Search(region, lines, {}, 0).empty());
  const std::vector<Segment2> points(5, Segment2{{3, 3}, {3, 3}});
  search.SetImage(testing::RoomCamera(), points);
  EXPECT_TRUE(search.Search(region, lines, {}, 0).empty());
}

TEST(PoseSearch, OneHypothesisIsThePrior) {
  PoseSearch search;
  const auto lines = RoomSearchLines();
  const Rigid3 truth = QueryPose(1);
  const auto segments = testing::Render(testing::RoomLines(), truth, 3);
  search.SetImage(testing::RoomCamera(), segments);
  const auto found = search.Search({truth, 0.01, 0.03}, lines, {.num_hypotheses = 1}, 0);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT(DistanceBetween(found[0].cam_from_world, truth).position_m, 0.03);
}

TEST(PoseSearch, LargeAndMirroredImagesAreSearchedAlike) {
  PoseSearch search;
  Random random(4);
  const auto lines = RoomSearchLines();
  const Rigid3 truth = QueryPose(0);
  const auto segments = testing::Render(testing::RoomLines(), truth, 4);
  const Rigid3 prior = Disturb(truth, 0.1, 2.0 * kDegree, &random);
  // Three times the resolution, and the image upside down.
  Camera large = testing::RoomCamera();
  large.fx *= 3;
  large.fy *= -3;
  large.cx = 3 * (large.cx + 0.5) - 0.5;
  large.width_px *= 3;
  large.height_px *= 3;
  const double cy = testing::RoomCamera().cy;
  large.cy = 3 * (cy + 0.5) - 0.5;
  std::vector<Segment2> scaled;
  for (const Segment2& s : segments) {
    const auto map = [&](const Eigen::Vector2d& p) {
      return Eigen::Vector2d(3 * (p.x() + 0.5) - 0.5, 2 * large.cy - (3 * (p.y() + 0.5) - 0.5));
    };
    scaled.push_back({map(s.start), map(s.end)});
  }
  search.SetImage(large, scaled);
  const auto found = search.Search({prior, 2.0 * kDegree, 0.1}, lines, {}, 0);
  ASSERT_FALSE(found.empty());
  EXPECT_LT(DistanceBetween(found[0].cam_from_world, truth).position_m, 0.03);
}

}  // namespace
}  // namespace plumb
