#include "plumb/geometry/line_projection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace plumb {
namespace {

constexpr Camera kCamera{500.0, 500.0, 320.0, 240.0, 641, 481};
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Segment3 RandomSegment(std::mt19937* rng, double half) {
  std::uniform_real_distribution<double> at(-half, half);
  return {{at(*rng), at(*rng), at(*rng)}, {at(*rng), at(*rng), at(*rng)}};
}

/// The segment on z = 1 m whose image runs between these pixels.
Segment3 Imaged(const Eigen::Vector2d& start_px, const Eigen::Vector2d& end_px, double z = 1.0) {
  return {z * kCamera.Normalize(start_px).homogeneous(),
          z * kCamera.Normalize(end_px).homogeneous()};
}

TEST(ProjectLine, ContainsTheImagesOfItsPoints) {
  std::mt19937 rng(1);
  Camera mirrored = kCamera;
  mirrored.fx = -480.0;
  for (int trial = 0; trial < 200; ++trial) {
    Segment3 segment = RandomSegment(&rng, 2.0);
    segment.start.z() += 3.0;
    segment.end.z() += 3.0;
    for (const Camera& camera : {kCamera, mirrored}) {
      const auto line = ProjectLine(camera, segment);
      ASSERT_TRUE(line);
      for (const double u : {-0.3, 0.0, 0.4, 1.0}) {
        const Eigen::Vector3d point = segment.start + u * segment.Delta();
        if (point.z() < 0.3) continue;
        EXPECT_LT(std::abs(line->SignedDistance(camera.Project(point))), 1e-7);
      }
    }
  }
}

TEST(ProjectLine, MeasuresDistanceInPixels) {
  const auto line = ProjectLine(kCamera, Imaged({0.0, 100.0}, {640.0, 100.0}));
  ASSERT_TRUE(line);
  EXPECT_NEAR(std::abs(line->SignedDistance({77.0, 103.5})), 3.5, 1e-9);
  EXPECT_NEAR(line->abc.head<2>().norm(), 1.0, 1e-12);
}

TEST(ProjectLine, DoesNotDependOnScaleOrOnWhichPointsSpanTheLine) {
  const Segment3 segment = {{-0.3, 0.2, 2.0}, {0.5, -0.1, 3.0}};
  const auto line = ProjectLine(kCamera, segment);
  for (const double scale : {1e-6, 1.0, 1e6}) {
    const auto scaled = ProjectLine(kCamera, {scale * segment.start, scale * segment.end});
    ASSERT_TRUE(scaled) << scale;
    EXPECT_TRUE(scaled->abc.isApprox(line->abc, 1e-9)) << scale;
  }
  const Eigen::Vector3d beyond = segment.start + 2.5 * segment.Delta();
  EXPECT_TRUE(ProjectLine(kCamera, {segment.start, beyond})->abc.isApprox(line->abc, 1e-9));
}

TEST(ProjectLine, ExistsForALineThatPassesBehindTheCamera) {
  const Segment3 segment = {{1.0, 0.0, 2.0}, {1.0, 0.0, -2.0}};
  const auto line = ProjectLine(kCamera, segment);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->SignedDistance(kCamera.Project({1.0, 0.0, 5.0})), 0.0, 1e-9);
}

TEST(ProjectLine, DoesNotExistForALineThroughTheOpticalCentre) {
  EXPECT_FALSE(ProjectLine(kCamera, {{0.0, 0.0, 1.0}, {0.0, 0.0, 2.0}}));
  EXPECT_FALSE(ProjectLine(kCamera, {{0.1, 0.2, 1.0}, {-0.3, -0.6, -3.0}}));
}

TEST(ProjectLine, DoesNotExistForALineInTheFocalPlane) {
  EXPECT_FALSE(ProjectLine(kCamera, {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}}));
}

TEST(ProjectLine, DoesNotExistForCoincidentOrNonFinitePoints) {
  const Eigen::Vector3d x(0.1, 0.2, 3.0);
  EXPECT_FALSE(ProjectLine(kCamera, {x, x}));
  EXPECT_FALSE(ProjectLine(kCamera, {x, {kNan, 0.0, 1.0}}));
  EXPECT_FALSE(ProjectLine(kCamera, {{0.0, 0.0, 0.0}, x}));
}

TEST(ProjectSegment, KeepsWhatIsInside) {
  const auto image = ProjectSegmentInCam(kCamera, Imaged({10.0, 20.0}, {600.0, 400.0}));
  ASSERT_TRUE(image);
  EXPECT_LT((image->start - Eigen::Vector2d(10.0, 20.0)).norm(), 1e-9);
  EXPECT_LT((image->end - Eigen::Vector2d(600.0, 400.0)).norm(), 1e-9);
}

TEST(ProjectSegment, ClipsToTheCentresOfTheOuterPixels) {
  const auto image = ProjectSegmentInCam(kCamera, Imaged({-100.0, 240.0}, {740.0, 240.0}));
  ASSERT_TRUE(image);
  EXPECT_NEAR(image->start.x(), 0.0, 1e-9);
  EXPECT_NEAR(image->end.x(), 640.0, 1e-9);
}

TEST(ProjectSegment, ClipsToTheEnlargedImage) {
  const Segment3 segment = Imaged({320.0, -500.0}, {320.0, 900.0});
  const auto image = ProjectSegmentInCam(kCamera, segment, /*margin_px=*/25.0);
  ASSERT_TRUE(image);
  EXPECT_NEAR(image->start.y(), -25.0, 1e-9);
  EXPECT_NEAR(image->end.y(), 505.0, 1e-9);
}

TEST(ProjectSegment, ShowsNothingOfALineOutside) {
  EXPECT_FALSE(ProjectSegmentInCam(kCamera, Imaged({-50.0, 10.0}, {-1.0, 470.0})));
  EXPECT_FALSE(ProjectSegmentInCam(kCamera, Imaged({-10.0, -20.0}, {700.0, -1.0})));
  // Past the corner, though it crosses both border lines.
  EXPECT_FALSE(ProjectSegmentInCam(kCamera, Imaged({-20.0, 10.0}, {10.0, -21.0})));
}

TEST(ProjectSegment, ShowsNothingOfALineBehindTheNearPlane) {
  EXPECT_FALSE(ProjectSegmentInCam(kCamera, {{-1.0, 0.0, -1.0}, {1.0, 0.0, -1.0}}));
  EXPECT_FALSE(ProjectSegmentInCam(kCamera, {{0.0, 0.0, 0.05}, {0.01, 0.0, 0.09}}));
}

TEST(ProjectSegment, CutsALineThatCrossesTheNearPlaneWhereItCrosses) {
  // Towards the camera and past it, 0.02 m to the right: at z = 0.1 its image is at x = 420.
  const auto image = ProjectSegmentInCam(kCamera, {{0.02, 0.0, 1.0}, {0.02, 0.0, -3.0}});
  ASSERT_TRUE(image);
  EXPECT_NEAR(image->start.x(), 330.0, 1e-9);
  EXPECT_NEAR(image->end.x(), 420.0, 1e-9);
  // The other way round it is the same.
  const auto reversed = ProjectSegmentInCam(kCamera, {{0.02, 0.0, -3.0}, {0.02, 0.0, 1.0}});
  ASSERT_TRUE(reversed);
  EXPECT_NEAR(reversed->start.x(), 420.0, 1e-9);
  EXPECT_NEAR(reversed->end.x(), 330.0, 1e-9);
}

TEST(ProjectSegment, IsAPointWithoutLengthForALineAlongARay) {
  const auto image = ProjectSegmentInCam(kCamera, {{0.1, 0.1, 1.0}, {0.3, 0.3, 3.0}});
  ASSERT_TRUE(image);
  EXPECT_LT(image->Length(), 1e-9);
}

TEST(ProjectSegment, DoesNotExistForNumbersThatAreNotFinite) {
  const Eigen::Vector3d good(0.1, 0.1, 2.0);
  for (int i = 0; i < 3; ++i) {
    for (const double value : {kNan, std::numeric_limits<double>::infinity()}) {
      Eigen::Vector3d bad = good;
      bad[i] = value;
      EXPECT_FALSE(ProjectSegmentInCam(kCamera, {good, bad})) << "end, component " << i;
      EXPECT_FALSE(ProjectSegmentInCam(kCamera, {bad, good})) << "start, component " << i;
    }
  }
}

TEST(ProjectSegment, TransformsFromTheWorldFirst) {
  const Eigen::Quaterniond rotation = ExpSo3({0.1, -0.5, 0.2});
  const Rigid3 cam_from_world = {rotation, {0.3, 0.2, 0.1}};
  const Segment3 in_cam = Imaged({100.0, 50.0}, {500.0, 300.0}, 3.0);
  const Rigid3 world_from_cam = cam_from_world.Inverse();
  const auto image = ProjectSegment(kCamera, cam_from_world,
                                    {world_from_cam * in_cam.start, world_from_cam * in_cam.end});
  ASSERT_TRUE(image);
  EXPECT_LT((image->start - Eigen::Vector2d(100.0, 50.0)).norm(), 1e-9);
  EXPECT_LT((image->end - Eigen::Vector2d(500.0, 300.0)).norm(), 1e-9);
}

TEST(ProjectSegment, ShowsExactlyThePointsThatTheCameraSees) {
  std::mt19937 rng(2);
  int num_visible = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const Segment3 segment = RandomSegment(&rng, 3.0);
    const double margin = trial % 3 * 40.0;
    const auto image = ProjectSegmentInCam(kCamera, segment, margin);
    if (image) {
      ++num_visible;
      EXPECT_TRUE(kCamera.Contains(image->start, margin + 1e-6));
      EXPECT_TRUE(kCamera.Contains(image->end, margin + 1e-6));
    }
    for (int k = 0; k <= 50; ++k) {
      const Eigen::Vector3d point = segment.start + k / 50.0 * segment.Delta();
      if (std::abs(point.z() - kNearPlane) < 1e-3) continue;
      const bool seen = point.z() > kNearPlane && kCamera.Contains(kCamera.Project(point), margin);
      if (!seen) continue;
      ASSERT_TRUE(image) << "trial " << trial << ": a visible point of an invisible segment";
      const Eigen::Vector2d delta = image->Delta();
      const double u = (kCamera.Project(point) - image->start).dot(delta) / delta.squaredNorm();
      ASSERT_GT(u, -1e-6);
      ASSERT_LT(u, 1.0 + 1e-6);
    }
  }
  EXPECT_GT(num_visible, 500);
}

}  // namespace
}  // namespace plumb
