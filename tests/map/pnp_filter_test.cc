// The PnP-RANSAC filter of a key frame's observations.
#include "plumb/map/pnp_filter.h"

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/geometry/rigid3.h"

namespace plumb {
namespace {

constexpr Camera kCamera{500.0, 500.0, 320.0, 240.0, 640, 480};

std::vector<PnpObservation> Observe(const Camera& camera, const Rigid3& cam_from_world, int count,
                                    double noise_px) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> normal;
  std::vector<PnpObservation> observations;
  const Rigid3 world_from_cam = cam_from_world.Inverse();
  for (int k = 0; k < count; ++k) {
    PnpObservation observation;
    Eigen::Vector2d* pixels[2] = {&observation.segment_px.start, &observation.segment_px.end};
    Eigen::Vector3d* points[2] = {&observation.predicted_in_world.start,
                                  &observation.predicted_in_world.end};
    for (int e = 0; e < 2; ++e) {
      const Eigen::Vector3d in_cam(uniform(random), 0.7 * uniform(random), 3.0 + uniform(random));
      *points[e] = world_from_cam * in_cam;
      *pixels[e] =
          camera.Project(in_cam) + noise_px * Eigen::Vector2d(normal(random), normal(random));
    }
    observations.push_back(observation);
  }
  return observations;
}

const Rigid3 kPose{ExpSo3({0.2, -0.4, 0.1}), {0.3, -0.2, 0.5}};

TEST(PnpFilter, KeepsObservationsThatAgree) {
  const auto inliers = PnpInliers(kCamera, Observe(kCamera, kPose, 60, 0.3), {});
  EXPECT_EQ(std::count(inliers.begin(), inliers.end(), true), 60);
}

TEST(PnpFilter, RejectsAnObservationWithOneWrongEnd) {
  auto observations = Observe(kCamera, kPose, 60, 0.3);
  observations[5].predicted_in_world.start += Eigen::Vector3d(0.0, 0.1, 0.0);
  observations[17].segment_px.end.x() += 12.0;
  const auto inliers = PnpInliers(kCamera, observations, {});
  EXPECT_FALSE(inliers[5]);
  EXPECT_FALSE(inliers[17]);
  EXPECT_EQ(std::count(inliers.begin(), inliers.end(), true), 58);
}

TEST(PnpFilter, ToleratesAKeyFramePoseThatIsOff) {
  // All predictions moved together: another pose explains them.
  auto observations = Observe(kCamera, kPose, 60, 0.3);
  const Rigid3 shift{ExpSo3({0.0, 0.03, 0.0}), {0.05, 0.0, 0.02}};
  for (PnpObservation& o : observations) {
    o.predicted_in_world = {shift * o.predicted_in_world.start, shift * o.predicted_in_world.end};
  }
  const auto inliers = PnpInliers(kCamera, observations, {});
  EXPECT_EQ(std::count(inliers.begin(), inliers.end(), true), 60);
}

TEST(PnpFilter, WorksWithAMirroredAxis) {
  const Camera mirrored{481.2, -480.0, 319.5, 239.5, 640, 480};
  auto observations = Observe(mirrored, kPose, 40, 0.3);
  observations[3].segment_px.start.y() += 15.0;
  const auto inliers = PnpInliers(mirrored, observations, {});
  EXPECT_FALSE(inliers[3]);
  EXPECT_EQ(std::count(inliers.begin(), inliers.end(), true), 39);
}

TEST(PnpFilter, SaysNothingWithoutConsensus) {
  EXPECT_TRUE(PnpInliers(kCamera, {}, {}).empty());
  auto few = Observe(kCamera, kPose, 5, 0.3);
  few[0].segment_px.start.x() += 50.0;
  for (const bool inlier : PnpInliers(kCamera, few, {})) EXPECT_TRUE(inlier);

  auto random_pairs = Observe(kCamera, kPose, 30, 0.0);
  const auto others = Observe(kCamera, Rigid3(), 60, 0.0);
  for (int k = 0; k < 30; ++k) random_pairs[k].segment_px = others[59 - k].segment_px;
  for (const bool inlier : PnpInliers(kCamera, random_pairs, {})) EXPECT_TRUE(inlier);
}

TEST(PnpFilter, PredictionsThatAreNotFiniteAreRejected) {
  auto observations = Observe(kCamera, kPose, 60, 0.3);
  observations[8].predicted_in_world.end.x() = std::numeric_limits<double>::quiet_NaN();
  const auto inliers = PnpInliers(kCamera, observations, {});
  EXPECT_FALSE(inliers[8]);
  EXPECT_EQ(std::count(inliers.begin(), inliers.end(), true), 59);
}

TEST(PnpFilter, ThresholdIsInPixels) {
  auto observations = Observe(kCamera, kPose, 60, 0.0);
  observations[0].segment_px.start.x() += 4.0;
  PnpFilterOptions options;
  options.threshold_px = 6.0;
  EXPECT_TRUE(PnpInliers(kCamera, observations, options)[0]);
  options.threshold_px = 2.0;
  EXPECT_FALSE(PnpInliers(kCamera, observations, options)[0]);
}

TEST(PnpFilter, Repeats) {
  const auto observations = Observe(kCamera, kPose, 60, 1.5);
  EXPECT_EQ(PnpInliers(kCamera, observations, {}), PnpInliers(kCamera, observations, {}));
}

}  // namespace
}  // namespace plumb
