#include "tools/metrics/normalised_error.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

namespace plumb::tools {
namespace {

/// Refined poses that are off by draws from `promised` times `factor`.
std::vector<PoseWithCovariance> Draw(const Matrix6d& promised, double factor, int count) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const Matrix6d root = (factor * promised).llt().matrixL();
  std::vector<PoseWithCovariance> frames;
  for (int i = 0; i < count; ++i) {
    Vector6d draw;
    for (int k = 0; k < 6; ++k) draw[k] = normal(random);
    const Rigid3 refined{ExpSo3({0.3, -0.5, 0.1 * i}), {1.0, 2.0, 0.5}};
    frames.push_back({Perturb(refined, root * draw), refined, promised});
  }
  return frames;
}

Matrix6d Promised() {
  Vector6d sigma;
  sigma << 1e-3, 2e-3, 1e-3, 0.004, 0.002, 0.006;
  Matrix6d covariance = (sigma.array() * sigma.array()).matrix().asDiagonal();
  covariance(0, 4) = covariance(4, 0) = 1e-6;
  return covariance;
}

TEST(EvaluateCovariances, RightOnesGiveOne) {
  const NormalisedErrors errors = EvaluateCovariances(Draw(Promised(), 1.0, 2000));
  EXPECT_EQ(errors.num_frames, 2000u);
  for (const NormalisedError& e : {errors.pose, errors.rotation, errors.position}) {
    EXPECT_NEAR(e.median, 1.0, 0.1);
    EXPECT_NEAR(e.mean, 1.0, 0.1);
  }
}

TEST(EvaluateCovariances, VariancesTooSmallByNineGiveNine) {
  const NormalisedErrors errors = EvaluateCovariances(Draw(Promised(), 9.0, 2000));
  EXPECT_NEAR(errors.pose.median, 9.0, 0.9);
  EXPECT_NEAR(errors.pose.mean, 9.0, 0.9);
}

TEST(EvaluateCovariances, OneBadPoseMovesTheMeanOnly) {
  std::vector<PoseWithCovariance> frames = Draw(Promised(), 1.0, 101);
  frames[50].true_cam_from_world.translation.x() += 1.0;
  const NormalisedErrors errors = EvaluateCovariances(frames);
  EXPECT_LT(errors.position.median, 1.5);
  EXPECT_GT(errors.position.mean, 20.0);
}

TEST(EvaluateCovariances, LeavesOutWhatIsNoCovariance) {
  std::vector<PoseWithCovariance> frames = Draw(Promised(), 1.0, 3);
  frames[1].covariance(0, 0) = -1.0;
  EXPECT_EQ(EvaluateCovariances(frames).num_frames, 2u);
  EXPECT_EQ(EvaluateCovariances({}).num_frames, 0u);
  EXPECT_EQ(EvaluateCovariances({}).pose.median, 0.0);
}

}  // namespace
}  // namespace plumb::tools
