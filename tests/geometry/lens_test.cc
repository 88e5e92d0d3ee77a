// Lenses against OpenCV's own formulas, their inverse, their derivatives, and what is refused.
#include "plumb/geometry/lens.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

namespace plumb {
namespace {

using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Lens Make(LensModel model, const std::vector<double>& coefficients) {
  return *MakeLens(model, coefficients);
}

// From a mild webcam to what breaks simple iterations.
std::vector<Lens> AllLenses() {
  return {Make(LensModel::kRadTan, {-0.3, 0.1, 0.0, 0.0}),
          Make(LensModel::kRadTan, {-0.28, 0.07, 0.0002, 0.00002}),      // EuRoC's
          Make(LensModel::kRadTan, {0.26, -0.95, -0.005, 0.003, 1.16}),  // TUM freiburg1's
          Make(LensModel::kRadTan, {0.2, 0.05, 0.001, -0.002, 0.01, 0.5, 0.1, 0.02}),
          Make(LensModel::kRadTan, {-0.3, 0.0, 0.01, -0.01}),
          Make(LensModel::kKannalaBrandt, {0.0, 0.0, 0.0, 0.0}),
          Make(LensModel::kKannalaBrandt, {-0.02, 0.007, -0.005, 0.001}),
          Make(LensModel::kKannalaBrandt, {0.1, -0.05, 0.02, -0.003})};
}

// Points out to 0.98 of what the lens can be inverted for, in all directions, and the centre.
std::vector<Eigen::Vector2d> PointsWithin(double radius) {
  std::vector<Eigen::Vector2d> points = {Eigen::Vector2d::Zero(), {1e-9, -1e-10}, {2e-5, 1e-5}};
  for (int ring = 1; ring <= 7; ++ring) {
    for (int step = 0; step < 12; ++step) {
      const double angle = 0.1 + step * 3.14159265 / 6.0;
      points.emplace_back(Eigen::Vector2d(std::cos(angle), std::sin(angle)) * 0.14 * ring * radius);
    }
  }
  return points;
}

Eigen::Vector2d OpenCvDistort(const Lens& lens, const Eigen::Vector2d& ideal) {
  const std::vector<double> k(
      lens.coefficients.begin(),
      lens.coefficients.begin() + (lens.model == LensModel::kRadTan ? 8 : 4));
  const cv::Mat camera = cv::Mat::eye(3, 3, CV_64F);
  std::vector<cv::Point2d> out;
  if (lens.model == LensModel::kRadTan) {
    cv::projectPoints(std::vector<cv::Point3d>{{ideal.x(), ideal.y(), 1.0}}, cv::Vec3d(),
                      cv::Vec3d(), camera, k, out);
  } else {
    cv::fisheye::distortPoints(std::vector<cv::Point2d>{{ideal.x(), ideal.y()}}, out, camera, k);
  }
  return {out[0].x, out[0].y};
}

TEST(Lens, DistortsAsOpenCvDoes) {
  for (const Lens& lens : AllLenses()) {
    const auto mapping = LensMapping::Create(lens);
    ASSERT_TRUE(mapping) << mapping.error().message;
    for (const Eigen::Vector2d& ideal : PointsWithin(mapping->max_radius())) {
      const auto distorted = mapping->Distort(ideal);
      ASSERT_TRUE(distorted);
      EXPECT_LT((distorted->point - OpenCvDistort(lens, ideal)).norm(), 1e-12);
    }
  }
}

TEST(Lens, UndistortInvertsDistortUpToTheLargestRadius) {
  for (const Lens& lens : AllLenses()) {
    const LensMapping mapping = *LensMapping::Create(lens);
    EXPECT_GT(mapping.max_radius(), 0.5);
    for (const Eigen::Vector2d& ideal : PointsWithin(mapping.max_radius())) {
      const auto distorted = mapping.Distort(ideal);
      const auto back = mapping.Undistort(distorted->point);
      ASSERT_TRUE(back) << ToString(lens.model) << " at " << ideal.transpose();
      EXPECT_LT((*back - ideal).norm(), 1e-11 * (1.0 + ideal.norm()));
    }
  }
}

TEST(Lens, TheJacobianIsTheNumericalOne) {
  constexpr double kStep = 1e-6;
  for (const Lens& lens : AllLenses()) {
    const LensMapping mapping = *LensMapping::Create(lens);
    for (const Eigen::Vector2d& ideal : PointsWithin(mapping.max_radius())) {
      const Eigen::Matrix2d jacobian = mapping.Distort(ideal)->jacobian;
      for (int i = 0; i < 2; ++i) {
        const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(i);
        const Eigen::Vector2d numerical =
            (mapping.Distort(ideal + step)->point - mapping.Distort(ideal - step)->point) /
            (2.0 * kStep);
        EXPECT_LT((jacobian.col(i) - numerical).norm(), 1e-8)
            << ToString(lens.model) << " at " << ideal.transpose();
      }
    }
  }
}

TEST(Lens, NoneLeavesEveryPointAlone) {
  const LensMapping mapping = *LensMapping::Create(Lens{});
  const Eigen::Vector2d point(0.3, -12.0);
  EXPECT_EQ(mapping.Distort(point)->point, point);
  EXPECT_EQ(*mapping.Undistort(point), point);
}

TEST(Lens, WhatTheLensDoesNotImageHasNoInverse) {
  // r - 0.3 r^3 has its largest value, 0.703, at r = 1.054.
  const LensMapping barrel = *LensMapping::Create(Make(LensModel::kRadTan, {-0.3, 0.0, 0.0, 0.0}));
  EXPECT_LT(barrel.max_radius(), 1.054);
  EXPECT_GT(barrel.max_radius(), 0.95);
  EXPECT_TRUE(barrel.Undistort({0.69, 0.0}));
  EXPECT_FALSE(barrel.Undistort({0.71, 0.0}));
  EXPECT_FALSE(barrel.Distort({1.06, 0.0}));
  const LensMapping tangential =
      *LensMapping::Create(Make(LensModel::kRadTan, {-0.3, 0.0, 0.01, -0.01}));
  EXPECT_FALSE(tangential.Undistort({0.75, 0.0}));
  EXPECT_FALSE(tangential.Undistort({3.0, -40.0}));
  for (const double bad : {kNan, std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(barrel.Undistort({bad, 0.0}));
    EXPECT_FALSE(tangential.Undistort({0.0, bad}));
    EXPECT_FALSE(barrel.Distort({bad, 0.0}));
  }
}

TEST(Lens, AFisheyeSeesBeyondAHundredAndFortyDegrees) {
  const LensMapping fisheye =
      *LensMapping::Create(Make(LensModel::kKannalaBrandt, {0.0, 0.0, 0.0, 0.0}));
  const double seventy = 70.0 * 3.14159265358979 / 180.0;
  const auto ideal = fisheye.Undistort({seventy, 0.0});
  ASSERT_TRUE(ideal);
  EXPECT_NEAR(ideal->x(), std::tan(seventy), 1e-10);
  EXPECT_FALSE(fisheye.Undistort({1.6, 0.0})) << "behind the camera";
}

TEST(Lens, CountsOfCoefficientsAreChecked) {
  const auto message = [](LensModel model, size_t count) {
    const auto lens = MakeLens(model, std::vector<double>(count, 0.01));
    return lens ? std::string() : lens.error().message;
  };
  for (const size_t count : {4u, 5u, 8u}) EXPECT_EQ(message(LensModel::kRadTan, count), "");
  EXPECT_THAT(message(LensModel::kRadTan, 6), HasSubstr("RADTAN has 6"));
  EXPECT_THAT(message(LensModel::kKannalaBrandt, 5), HasSubstr("KANNALA_BRANDT has 5"));
  EXPECT_EQ(message(LensModel::kKannalaBrandt, 4), "");
  EXPECT_THAT(message(LensModel::kNone, 1), HasSubstr("NONE has 1"));
}

TEST(Lens, FewerCoefficientsAreZeros) {
  EXPECT_EQ(Make(LensModel::kRadTan, {-0.1, 0.02, 0.001, 0.002}),
            Make(LensModel::kRadTan, {-0.1, 0.02, 0.001, 0.002, 0.0, 0.0, 0.0, 0.0}));
}

TEST(Lens, BadCoefficientsAreNamed) {
  EXPECT_THAT(
      MakeLens(LensModel::kRadTan, std::vector<double>{0.1, kNan, 0.0, 0.0}).error().message,
      HasSubstr("coefficient 1 is nan"));
  Lens lens = Make(LensModel::kKannalaBrandt, {0.0, 0.0, 0.0, 0.0});
  lens.coefficients[6] = 0.5;
  EXPECT_THAT(LensMapping::Create(lens).error().message, HasSubstr("coefficient 6 is 0.5"));
  lens.coefficients[6] = kNan;
  EXPECT_THAT(LensMapping::Create(lens).error().message, HasSubstr("coefficient 6 is nan"));
  EXPECT_THAT(LensMapping::Create(Make(LensModel::kRadTan, {-1e9, 0.0, 0.0, 0.0})).error().message,
              HasSubstr("does not grow"));
}

}  // namespace
}  // namespace plumb
