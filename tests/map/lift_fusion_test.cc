// Segments that a depth image and other views have lifted.
#include "plumb/map/lift_fusion.h"

#include <vector>

#include <gtest/gtest.h>

#include "plumb/geometry/camera.h"

namespace plumb {
namespace {

constexpr Camera kCamera{500.0, 500.0, 319.5, 239.5, 640, 480};
const Rigid3 kPose{ExpSo3({0.1, -0.2, 0.3}), {0.4, 0.5, -0.6}};
const std::vector<Segment2> kSegments = {{{100, 100}, {300, 140}, 0.9f},
                                         {{400, 50}, {420, 350}, 0.8f}};

Eigen::Vector3d InCam(const Eigen::Vector2d& px, double depth_m) {
  return depth_m * kCamera.Normalize(px).homogeneous();
}

// The part of kSegments[source] from `begin` to `end`, at the depths of its ends.
LiftedPart Part(uint32_t source, double begin, double end, double start_m, double end_m) {
  const Segment2& whole = kSegments[source];
  LiftedPart part;
  part.source = source;
  part.segment_px = {whole.start + begin * whole.Delta(), whole.start + end * whole.Delta(),
                     whole.score};
  part.segment_in_cam = {InCam(part.segment_px.start, start_m), InCam(part.segment_px.end, end_m)};
  return part;
}

TriangulatedSegment ByViews(uint32_t source, double start_m, double end_m, double sigma_m) {
  TriangulatedSegment segment;
  segment.source = source;
  segment.depth_m = {start_m, end_m};
  segment.sigma_m = {sigma_m, sigma_m};
  return segment;
}

double DepthOf(const Eigen::Vector3d& in_world) { return (kPose * in_world).z(); }

TEST(LiftFusion, ComparesDepthsAtThePartsEndsOnly) {
  // Inverse depth is linear along a segment's image: 1 / 2 m and 1 / 4 m have 0.375 / m half-way.
  const std::vector<LiftedPart> parts = {Part(0, 0.5, 1.0, 2.5, 3.9), Part(1, 0.0, 1.0, 2.0, 2.0)};
  const std::vector<TriangulatedSegment> views = {ByViews(0, 2.0, 4.0, 0.02)};
  const FrameLifts frame{kPose, kSegments, parts, views};
  const std::vector<DepthSample> samples = CompareDepths({&frame, 1});
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_NEAR(samples[0].views, 0.375, 1e-12);
  EXPECT_NEAR(samples[0].sensor, 1.0 / 2.5, 1e-12);
  EXPECT_NEAR(samples[1].views, 0.25, 1e-12);
  EXPECT_NEAR(samples[1].views_sigma, 0.02 / 16.0, 1e-12);
  EXPECT_NEAR(samples[0].views_sigma, std::hypot(0.5 * 0.02 / 4.0, 0.5 * 0.02 / 16.0), 1e-12);
  const Eigen::Vector2d ray = kCamera.Normalize({200, 120});
  EXPECT_LT((samples[0].ray - ray).norm(), 1e-12);
}

TEST(LiftFusion, UncertainViewsAreNotCompared) {
  const std::vector<LiftedPart> parts = {Part(0, 0.0, 1.0, 2.0, 4.0)};
  const std::vector<TriangulatedSegment> views = {ByViews(0, 2.0, 4.0, 0.1)};  // 5 % and 2.5 %
  const FrameLifts frame{kPose, kSegments, parts, views};
  const std::vector<DepthSample> samples = CompareDepths({&frame, 1});
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_NEAR(samples[0].views, 0.25, 1e-12);
}

TEST(LiftFusion, DepthsThatAgreeAreAveragedByVariance) {
  const std::vector<LiftedPart> parts = {Part(0, 0.0, 1.0, 2.02, 2.02)};
  DepthFit fit;
  fit.noise_factor = 2.0;
  const double sensor_sigma_m = 2.0 * DepthNoise().SigmaAt(2.0);
  const auto fused_with = [&](double views_sigma_m) {
    const std::vector<TriangulatedSegment> views = {ByViews(0, 2.0, 2.0, views_sigma_m)};
    size_t averaged = 0;
    const auto segments = FuseLifts({kPose, kSegments, parts, views}, fit, {}, &averaged);
    EXPECT_EQ(segments.size(), 1u);
    EXPECT_EQ(averaged, 1u);
    EXPECT_NEAR(DepthOf(segments[0].segment_in_world.start),
                DepthOf(segments[0].segment_in_world.end), 1e-9);
    return DepthOf(segments[0].segment_in_world.start);
  };
  EXPECT_NEAR(fused_with(sensor_sigma_m), 2.01, 3e-4);
  EXPECT_NEAR(fused_with(0.1 * sensor_sigma_m), 2.0 + 0.02 / 101.0, 3e-4);
  EXPECT_NEAR(fused_with(10.0 * sensor_sigma_m), 2.02 - 0.02 / 101.0, 3e-4);
}

TEST(LiftFusion, ThePixelsAndTheRaysStay) {
  const std::vector<LiftedPart> parts = {Part(1, 0.2, 0.9, 2.0, 3.0)};
  const std::vector<TriangulatedSegment> views = {ByViews(1, 1.95, 3.1, 0.03)};
  const auto segments = FuseLifts({kPose, kSegments, parts, views}, {});
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(segments[0].segment_px.start, parts[0].segment_px.start);
  EXPECT_EQ(segments[0].segment_px.score, 0.8f);
  for (const auto& [in_world, px] :
       {std::pair(segments[0].segment_in_world.start, parts[0].segment_px.start),
        std::pair(segments[0].segment_in_world.end, parts[0].segment_px.end)}) {
    EXPECT_LT((kCamera.Project(kPose * in_world) - px).norm(), 1e-9);
  }
}

TEST(LiftFusion, SegmentsWithoutAPartAreTakenFromTheViews) {
  const std::vector<LiftedPart> parts = {Part(0, 0.0, 1.0, 2.0, 2.0)};
  TriangulatedSegment alone = ByViews(1, 3.0, 3.5, 0.05);
  alone.segment_in_world = {{1.0, 2.0, 3.0}, {1.5, 2.0, 3.0}};
  const std::vector<TriangulatedSegment> views = {ByViews(0, 2.0, 2.0, 0.01), alone};
  DepthFit fit;
  fit.correction.scale = {0.0, 0.0, -0.5};  // of the sensor, not of the views
  size_t averaged = 0;
  const auto segments = FuseLifts({kPose, kSegments, parts, views}, fit, {}, &averaged);
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_EQ(averaged, 0u);
  EXPECT_EQ(segments[1].segment_px.start, kSegments[1].start);
  EXPECT_EQ(segments[1].segment_px.score, kSegments[1].score);
  EXPECT_EQ(segments[1].segment_in_world.start, alone.segment_in_world.start);
  EXPECT_EQ(segments[1].segment_in_world.end, alone.segment_in_world.end);
}

TEST(LiftFusion, WhereViewsContradictTheCorrectedSensorCounts) {
  const std::vector<LiftedPart> parts = {Part(0, 0.0, 1.0, 2.0, 2.0), Part(1, 0.0, 1.0, 3.0, 3.0)};
  // One end agrees, the other does not.
  const std::vector<TriangulatedSegment> views = {ByViews(0, 2.0, 2.6, 0.01)};
  DepthFit fit;
  fit.correction.scale = {0.0, 0.0, -0.01};
  size_t averaged = 0;
  const auto segments = FuseLifts({kPose, kSegments, parts, views}, fit, {}, &averaged);
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_EQ(averaged, 0u);
  EXPECT_NEAR(DepthOf(segments[0].segment_in_world.start), 2.0 / 0.99, 1e-9);
  EXPECT_NEAR(DepthOf(segments[0].segment_in_world.end), 2.0 / 0.99, 1e-9);
  EXPECT_NEAR(DepthOf(segments[1].segment_in_world.end), 3.0 / 0.99, 1e-9);
}

}  // namespace
}  // namespace plumb
