#include "plumb/refine/uncertainty.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

namespace plumb {
namespace {

TEST(Observe, CountsDirectionsThatBeatThePrior) {
  const Matrix6d prior = 4.0 * Matrix6d::Identity();
  Vector6d information;
  information << 400, 40, 4.1, 3.9, 0.1, 0.0;
  const Observability seen = Observe(Matrix6d(information.asDiagonal()), prior);
  EXPECT_EQ(seen.num_observed, 3);
  EXPECT_NEAR(seen.gain[5], 100.0, 1e-9);
  EXPECT_NEAR(seen.gain[0], 0.0, 1e-9);
}

TEST(Observe, SeesADirectionThatIsNotAnAxis) {
  const Vector6d hidden = Vector6d::Ones().normalized();
  const Matrix6d information = 1e6 * (Matrix6d::Identity() - hidden * hidden.transpose());
  EXPECT_EQ(Observe(information, Matrix6d::Identity()).num_observed, 5);
}

TEST(PoseCovariance, IsTheInverseOfScaledLinesPlusPrior) {
  const Matrix6d lines = 200.0 * Matrix6d::Identity(), prior = 3.0 * Matrix6d::Identity();
  const Matrix6d covariance = PoseCovariance(lines, 2.0, 25.0, prior);
  EXPECT_LT((covariance - Matrix6d::Identity() / 7.0).norm(), 1e-12);
  EXPECT_EQ(covariance, covariance.transpose());
}

TEST(PoseCovariance, PerfectResidualsDoNotMakeItVanish) {
  const Matrix6d lines = 100.0 * Matrix6d::Identity(), prior = Matrix6d::Identity();
  EXPECT_EQ(PoseCovariance(lines, 0.0, 1.0, prior), PoseCovariance(lines, 0.02, 1.0, prior));
}

TEST(PoseCovariance, IsNeverWorseThanThePrior) {
  const Matrix6d prior = 10.0 * Matrix6d::Identity();
  const Matrix6d covariance = PoseCovariance(Matrix6d::Zero(), 1.0, 1.0, prior);
  EXPECT_LT((covariance - 0.1 * Matrix6d::Identity()).norm(), 1e-12);
}

TEST(PriorCovariance, SharesTheNormOverTheComponents) {
  const Matrix6d covariance = PriorCovariance(0.06, 0.3);
  EXPECT_NEAR(std::sqrt((covariance.topLeftCorner<3, 3>().trace())), 0.06, 1e-12);
  EXPECT_NEAR(std::sqrt((covariance.bottomRightCorner<3, 3>().trace())), 0.3, 1e-12);
}

}  // namespace
}  // namespace plumb
