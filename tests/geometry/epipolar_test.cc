#include "plumb/geometry/epipolar.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace plumb {
namespace {

constexpr Camera kCameraA{500.0, 500.0, 320.0, 240.0, 640, 480};
constexpr Camera kCameraB{610.0, -600.0, 300.0, 250.0, 640, 480};  // mirrored

Rigid3 PoseAt(const Eigen::Vector3d& center, const Eigen::Vector3d& rotation = {0, 0, 0}) {
  const Eigen::Quaterniond q = ExpSo3(rotation);
  return {q, -(q * center)};
}

/// Cameras side by side: epipolar lines are the image rows, the epipoles lie at infinity.
EpipolarGeometry SideBySide() {
  return *EpipolarGeometry::Create(kCameraA, PoseAt({0, 0, 0}), kCameraA, PoseAt({0.5, 0, 0}));
}

/// Camera b is 1 m behind camera a: the epipoles are the principal points.
EpipolarGeometry OneBehindTheOther() {
  return *EpipolarGeometry::Create(kCameraA, PoseAt({0, 0, 0}), kCameraA, PoseAt({0, 0, -1.0}));
}

TEST(EpipolarGeometry, VanishesForTheImagesOfOnePoint) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> at(-1.0, 1.0);
  for (int trial = 0; trial < 200; ++trial) {
    const Rigid3 a = PoseAt({at(rng), at(rng), at(rng)}, {0.3 * at(rng), 0.3 * at(rng), at(rng)});
    const Rigid3 b = PoseAt({at(rng), at(rng), at(rng)}, {0.3 * at(rng), 0.3 * at(rng), at(rng)});
    const auto geometry = EpipolarGeometry::Create(kCameraA, a, kCameraB, b);
    ASSERT_TRUE(geometry);
    const Eigen::Matrix3d& f = geometry->b_from_a_fundamental();
    EXPECT_NEAR(f.norm(), 1.0, 1e-12);
    EXPECT_NEAR(f.determinant(), 0.0, 1e-12);
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d x(at(rng), at(rng), 4.0 + at(rng));
      const Eigen::Vector2d image_a = kCameraA.Project(a * x), image_b = kCameraB.Project(b * x);
      const Eigen::Vector3d line = f * image_a.homogeneous();
      EXPECT_LT(std::abs(line.dot(image_b.homogeneous())) / line.head<2>().norm(), 1e-6);
    }
  }
}

TEST(EpipolarGeometry, IsTransposedWhenTheViewsChangePlaces) {
  const Rigid3 a = PoseAt({0.2, 0.1, 0.0}, {0.1, 0.2, 0.3}), b = PoseAt({-0.3, 0.0, 0.4});
  const Eigen::Matrix3d f =
      EpipolarGeometry::Create(kCameraA, a, kCameraB, b)->b_from_a_fundamental();
  const Eigen::Matrix3d g =
      EpipolarGeometry::Create(kCameraB, b, kCameraA, a)->b_from_a_fundamental();
  EXPECT_TRUE(f.isApprox(g.transpose(), 1e-9) || f.isApprox(-g.transpose(), 1e-9));
}

TEST(EpipolarGeometry, DoesNotExistForAPureRotation) {
  const Rigid3 a = PoseAt({1.0, 2.0, 3.0}), b = PoseAt({1.0, 2.0, 3.0}, {0.0, 0.3, 0.0});
  EXPECT_FALSE(EpipolarGeometry::Create(kCameraA, a, kCameraB, b));
  EXPECT_FALSE(EpipolarGeometry::Create(kCameraA, a, kCameraA, a));
}

TEST(EpipolarGeometry, DoesNotExistForBrokenInputs) {
  const Rigid3 a = PoseAt({0, 0, 0}), b = PoseAt({1, 0, 0});
  Camera camera = kCameraA;
  camera.fx = 0.0;
  EXPECT_FALSE(EpipolarGeometry::Create(camera, a, kCameraB, b));
  EXPECT_FALSE(EpipolarGeometry::Create(kCameraA, a, camera, b));
  Rigid3 broken = b;
  broken.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(EpipolarGeometry::Create(kCameraA, a, kCameraB, broken));
}

TEST(BandOf, IsTheEpipolarLinesOfTheEndPointsInPixels) {
  const auto band = SideBySide().BandOf({{100.0, 50.0}, {110.0, 90.0}});
  ASSERT_TRUE(band);
  EXPECT_NEAR(band->start.dot(Eigen::Vector3d(400.0, 50.0, 1.0)), 0.0, 1e-9);
  EXPECT_NEAR(std::abs(band->start.dot(Eigen::Vector3d(400.0, 57.0, 1.0))), 7.0, 1e-9);
  EXPECT_NEAR(std::abs(band->end.dot(Eigen::Vector3d(3.0, 92.0, 1.0))), 2.0, 1e-9);
}

TEST(BandOf, SaysNothingForASegmentWithoutLength) {
  EXPECT_FALSE(SideBySide().BandOf({{100.0, 50.0}, {100.0, 50.0}}));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(SideBySide().BandOf({{nan, 50.0}, {100.0, 50.0}}));
}

TEST(BandOf, SaysNothingWhenTheEpipoleLiesInTheSegment) {
  const EpipolarGeometry geometry = OneBehindTheOther();
  EXPECT_FALSE(geometry.BandOf({{300.0, 240.0}, {340.0, 240.0}}));
  EXPECT_FALSE(geometry.BandOf({{320.0, 240.0}, {400.0, 300.0}})) << "at an end point";
  EXPECT_FALSE(geometry.BandOf({{300.0, 241.9}, {340.0, 241.9}})) << "within 2 px";
  EXPECT_TRUE(geometry.BandOf({{300.0, 242.1}, {340.0, 242.1}}));
}

TEST(BandOf, SpeaksWhenOnlyTheSegmentsExtensionMeetsTheEpipole) {
  EXPECT_TRUE(OneBehindTheOther().BandOf({{323.0, 240.0}, {400.0, 240.0}}));
}

TEST(BandOf, NeverMeetsAnEpipoleAtInfinity) {
  EXPECT_TRUE(SideBySide().BandOf({{0.0, 240.0}, {640.0, 240.5}}));
}

TEST(EpipoleTouches, TellsSegmentsNearTheEpipoleOfTheSecondImage) {
  const EpipolarGeometry geometry = OneBehindTheOther();
  EXPECT_TRUE(geometry.EpipoleTouches({{300.0, 240.0}, {340.0, 240.0}}));
  EXPECT_TRUE(geometry.EpipoleTouches({{321.0, 241.0}, {321.0, 241.0}})) << "a point nearby";
  EXPECT_FALSE(geometry.EpipoleTouches({{300.0, 243.0}, {340.0, 243.0}}));
  EXPECT_FALSE(SideBySide().EpipoleTouches({{0.0, 240.0}, {640.0, 240.0}}));
}

TEST(EpipoleTouches, UsesTheSecondImagesOwnEpipole) {
  // Camera b sees camera a's centre straight ahead; camera a sees b's behind it, off the axis.
  const Rigid3 a = PoseAt({0, 0, 2.0}, {0.0, 0.4, 0.0}), b = PoseAt({0, 0, 0});
  const auto geometry = EpipolarGeometry::Create(kCameraA, a, kCameraB, b);
  ASSERT_TRUE(geometry);
  EXPECT_TRUE(geometry->EpipoleTouches({{290.0, 250.0}, {310.0, 250.0}}));
  EXPECT_TRUE(geometry->BandOf({{310.0, 240.0}, {330.0, 240.0}}));
}

TEST(BandOverlap, IsOneForTheSameLineInSpace) {
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> at(-1.0, 1.0);
  const Rigid3 a = PoseAt({0, 0, 0}), b = PoseAt({0.4, 0.1, -0.2}, {0.05, -0.1, 0.1});
  const auto geometry = EpipolarGeometry::Create(kCameraA, a, kCameraB, b);
  int num_told = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const Segment3 line = {{at(rng), at(rng), 4.0 + at(rng)}, {at(rng), at(rng), 4.0 + at(rng)}};
    const auto band =
        geometry->BandOf({kCameraA.Project(a * line.start), kCameraA.Project(a * line.end)});
    ASSERT_TRUE(band);
    const Segment2 image_b = {kCameraB.Project(b * line.start), kCameraB.Project(b * line.end)};
    if (const auto overlap = BandOverlap(*band, image_b)) {
      ++num_told;
      EXPECT_NEAR(*overlap, 1.0, 1e-6);
    }
  }
  EXPECT_GT(num_told, 90);
}

TEST(BandOverlap, IsInnerOverOuterLength) {
  const auto band = SideBySide().BandOf({{100.0, 100.0}, {100.0, 200.0}});
  ASSERT_TRUE(band);
  const auto overlap = [&](double top, double bottom) {
    return BandOverlap(*band, {{400.0, top}, {400.0, bottom}}).value();
  };
  EXPECT_NEAR(overlap(100.0, 200.0), 1.0, 1e-9);
  EXPECT_NEAR(overlap(100.0, 150.0), 0.5, 1e-9) << "a fragment";
  EXPECT_NEAR(overlap(100.0, 300.0), 0.5, 1e-9) << "longer than the band";
  EXPECT_NEAR(overlap(150.0, 250.0), 1.0 / 3.0, 1e-9) << "shifted";
  EXPECT_EQ(overlap(210.0, 300.0), 0.0) << "below";
  EXPECT_EQ(overlap(10.0, 90.0), 0.0) << "above";
}

TEST(BandOverlap, DoesNotDependOnTheOrderOfEndPoints) {
  const EpipolarGeometry geometry = SideBySide();
  const Segment2 a = {{100.0, 100.0}, {120.0, 200.0}}, b = {{400.0, 150.0}, {430.0, 260.0}};
  const auto reversed = [](const Segment2& s) { return Segment2{s.end, s.start}; };
  const double expected = BandOverlap(*geometry.BandOf(a), b).value();
  EXPECT_GT(expected, 0.1);
  EXPECT_NEAR(BandOverlap(*geometry.BandOf(reversed(a)), b).value(), expected, 1e-12);
  EXPECT_NEAR(BandOverlap(*geometry.BandOf(a), reversed(b)).value(), expected, 1e-12);
}

TEST(BandOverlap, DoesNotExistForALineParallelToAnEpipolarLine) {
  const auto band = SideBySide().BandOf({{100.0, 100.0}, {100.0, 200.0}});
  ASSERT_TRUE(band);
  EXPECT_FALSE(BandOverlap(*band, {{10.0, 150.0}, {500.0, 150.0}}));
  EXPECT_FALSE(BandOverlap(*band, {{10.0, 150.0}, {510.0, 159.0}})) << "1 degree";
  EXPECT_TRUE(BandOverlap(*band, {{10.0, 150.0}, {510.0, 167.0}})) << "2 degrees";
}

TEST(BandOverlap, DoesNotExistForASegmentWithoutLength) {
  const auto band = SideBySide().BandOf({{100.0, 100.0}, {100.0, 200.0}});
  EXPECT_FALSE(BandOverlap(*band, {{10.0, 150.0}, {10.0, 150.0}}));
}

TEST(BandOverlap, IsZeroWhereNothingIsAPixelLong) {
  const auto band = SideBySide().BandOf({{100.0, 100.0}, {100.0, 100.5}});
  ASSERT_TRUE(band);
  EXPECT_EQ(BandOverlap(*band, {{400.0, 100.0}, {400.0, 100.5}}).value(), 0.0);
}

TEST(BandOverlap, IsZeroForABandWithoutWidth) {
  // The segment points at the epipole, so both of its ends have the same epipolar line.
  const auto band = OneBehindTheOther().BandOf({{330.0, 240.0}, {400.0, 240.0}});
  ASSERT_TRUE(band);
  EXPECT_NEAR(BandOverlap(*band, {{350.0, 200.0}, {360.0, 300.0}}).value(), 0.0, 1e-9);
}

}  // namespace
}  // namespace plumb
