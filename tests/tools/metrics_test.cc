// Metrics against values computed by hand.
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "tools/metrics/percentile.h"
#include "tools/metrics/structural_ap.h"
#include "tools/metrics/trajectory_error.h"

namespace plumb::tools {
namespace {

Segment2 Line(double x1, double y1, double x2, double y2, double score = 1.0) {
  Segment2 segment;
  segment.start = {x1, y1};
  segment.end = {x2, y2};
  segment.score = score;
  return segment;
}

TEST(Percentile, InterpolatesBetweenRanks) {
  EXPECT_DOUBLE_EQ(Percentile({4, 1, 3, 2}, 50), 2.5);
  EXPECT_DOUBLE_EQ(Percentile({4, 1, 3, 2}, 90), 3.7);
  EXPECT_DOUBLE_EQ(Percentile({4, 1, 3, 2}, 0), 1.0);
  EXPECT_DOUBLE_EQ(Percentile({4, 1, 3, 2}, 100), 4.0);
  EXPECT_DOUBLE_EQ(Percentile({7}, 90), 7.0);
  EXPECT_TRUE(std::isnan(Percentile({}, 50)));
}

TEST(StructuralAp, PerfectDetectionsScore100) {
  const std::vector<LineEvaluation> images{{128,
                                            128,
                                            {Line(0, 0, 10, 0, 0.1), Line(5, 5, 9, 90, 0.2)},
                                            {Line(5, 5, 9, 90), Line(0, 0, 10, 0)}}};
  EXPECT_DOUBLE_EQ(StructuralAp(images, 5), 100.0);
}

TEST(StructuralAp, OrderOfTheEndPointsDoesNotMatter) {
  const std::vector<LineEvaluation> images{{128, 128, {Line(10, 0, 0, 0)}, {Line(0, 0, 10, 0)}}};
  EXPECT_DOUBLE_EQ(StructuralAp(images, 5), 100.0);
}

TEST(StructuralAp, SecondDetectionOfALineIsAMiss) {
  // Hits by score: yes, no, yes; precision 1, 1/2, 2/3; recall 1/2, 1/2, 1.
  const std::vector<LineEvaluation> images{
      {128,
       128,
       {Line(0, 0, 10, 0, 0.9), Line(0, 0, 10, 0, 0.8), Line(0, 50, 10, 52, 0.7)},
       {Line(0, 0, 10, 0), Line(0, 50, 10, 50)}}};
  EXPECT_NEAR(StructuralAp(images, 5), 100.0 * (1.0 + 2.0 / 3.0) / 2.0, 1e-12);
}

TEST(StructuralAp, ThresholdIsStrict) {
  const std::vector<LineEvaluation> images{{128, 128, {Line(1, 2, 10, 0)}, {Line(0, 0, 10, 0)}}};
  EXPECT_DOUBLE_EQ(StructuralAp(images, 5), 0.0);  // the squared distance is 5
  EXPECT_DOUBLE_EQ(StructuralAp(images, 10), 100.0);
}

TEST(StructuralAp, NeverFallsBackToTheSecondNearest) {
  // Both detections are nearest to the first line although the second is in reach.
  const std::vector<LineEvaluation> images{{128,
                                            128,
                                            {Line(0, 0, 10, 0, 0.9), Line(0, 0.5, 10, 0.5, 0.8)},
                                            {Line(0, 0, 10, 0), Line(0, 2, 10, 2)}}};
  EXPECT_DOUBLE_EQ(StructuralAp(images, 15), 50.0);
}

TEST(StructuralAp, BothAxesScaleTo128) {
  // 3 px of 256 are 1.5, 3 px of 64 are 6 in the 128 grid.
  EXPECT_DOUBLE_EQ(
      StructuralAp(std::vector<LineEvaluation>{{256, 64, {Line(3, 0, 50, 0)}, {Line(0, 0, 50, 0)}}},
                   5),
      100.0);
  EXPECT_DOUBLE_EQ(
      StructuralAp(std::vector<LineEvaluation>{{256, 64, {Line(0, 3, 50, 0)}, {Line(0, 0, 50, 0)}}},
                   15),
      0.0);
}

TEST(StructuralAp, RanksOverAllImages) {
  // The best score is a miss in the second image: precision 0, 1/2, 1/3, 2/4 -> hits see 1/2, 1/2.
  const std::vector<LineEvaluation> images{
      {128, 128, {Line(0, 0, 10, 0, 0.8), Line(0, 30, 10, 30, 0.5)}, {Line(0, 0, 10, 0)}},
      {128, 128, {Line(90, 90, 90, 10, 0.9), Line(0, 0, 20, 0, 0.4)}, {Line(0, 0, 20, 0)}}};
  EXPECT_NEAR(StructuralAp(images, 5), 50.0, 1e-12);
}

TEST(StructuralAp, ImagesWithoutDetectionsLowerTheRecall) {
  const std::vector<LineEvaluation> images{{128, 128, {Line(0, 0, 10, 0)}, {Line(0, 0, 10, 0)}},
                                           {128, 128, {}, {Line(0, 0, 10, 0)}}};
  EXPECT_DOUBLE_EQ(StructuralAp(images, 5), 50.0);
}

TEST(StructuralAp, NothingAnnotatedOrDetectedIsZero) {
  EXPECT_DOUBLE_EQ(StructuralAp(std::vector<LineEvaluation>{}, 5), 0.0);
  EXPECT_DOUBLE_EQ(StructuralAp(std::vector<LineEvaluation>{{128, 128, {Line(0, 0, 1, 1)}, {}}}, 5),
                   0.0);
  EXPECT_DOUBLE_EQ(StructuralAp(std::vector<LineEvaluation>{{128, 128, {}, {Line(0, 0, 1, 1)}}}, 5),
                   0.0);
}

/// A camera at (x_cm, 0, 0) that is turned by `deg` about z.
Rigid3 Pose(double x_cm, double deg) {
  const Rigid3 world_from_cam{ExpSo3({0, 0, deg * std::numbers::pi / 180}), {x_cm / 100, 0, 0}};
  return world_from_cam.Inverse();
}

TEST(TrajectoryError, MediansAndRecallsByHand) {
  const std::vector<FrameEvaluation> frames{{Pose(0, 0), Pose(10, 2), Pose(1, 0.5)},
                                            {Pose(50, 9), Pose(60, 11), Pose(53, 10)},
                                            {Pose(0, 0), Pose(-10, -2), Pose(0, 7)},
                                            {Pose(0, 0), Pose(10, -2), Pose(-5.5, 0)}};
  const TrajectoryEvaluation e = EvaluateTrajectory(frames);
  EXPECT_EQ(e.num_frames, 4u);
  EXPECT_NEAR(e.prior.median_cm, 10.0, 1e-9);
  EXPECT_NEAR(e.prior.median_deg, 2.0, 1e-9);
  EXPECT_NEAR(e.refined.median_cm, 2.0, 1e-9);    // 1, 3, 0, 5.5
  EXPECT_NEAR(e.refined.median_deg, 0.75, 1e-9);  // 0.5, 1, 7, 0
  EXPECT_NEAR(e.refined.p90_cm, 3.0 + 0.7 * 2.5, 1e-9);
  EXPECT_NEAR(e.refined.p90_deg, 1.0 + 0.7 * 6.0, 1e-9);
  EXPECT_DOUBLE_EQ(e.refined.recall_2cm_2deg, 0.25);
  EXPECT_DOUBLE_EQ(e.refined.recall_5cm_5deg, 0.5);
  EXPECT_DOUBLE_EQ(e.improved, 0.75);
  EXPECT_DOUBLE_EQ(e.harmed, 0.25);  // the third: 5 degrees worse although 10 cm nearer
}

TEST(TrajectoryError, KeptPriorsNeitherImproveNorHarm) {
  const std::vector<FrameEvaluation> frames{{Pose(0, 0), Pose(3, 1), Pose(3, 1)},
                                            {Pose(0, 0), Pose(3, 1), Pose(3.4, 1.05)}};
  const TrajectoryEvaluation e = EvaluateTrajectory(frames);
  EXPECT_DOUBLE_EQ(e.improved, 0.0);
  EXPECT_DOUBLE_EQ(e.harmed, 0.0);  // worse, but by less than 0.5 cm and 0.1 deg
}

TEST(TrajectoryError, HarmCountsFromHalfACentimetreOrATenthOfADegree) {
  EXPECT_DOUBLE_EQ(
      EvaluateTrajectory(std::vector<FrameEvaluation>{{Pose(0, 0), Pose(3, 1), Pose(3.51, 0)}})
          .harmed,
      1.0);
  EXPECT_DOUBLE_EQ(
      EvaluateTrajectory(std::vector<FrameEvaluation>{{Pose(0, 0), Pose(3, 1), Pose(0, 1.11)}})
          .harmed,
      1.0);
}

TEST(TrajectoryError, NothingAlignsTheTrajectories) {
  // A constant offset that an alignment would remove stays an error.
  std::vector<FrameEvaluation> frames;
  for (int i = 0; i < 5; ++i) frames.push_back({Pose(i, 0), Pose(i + 9, 0), Pose(i + 7, 0)});
  EXPECT_NEAR(EvaluateTrajectory(frames).refined.median_cm, 7.0, 1e-9);
}

}  // namespace
}  // namespace plumb::tools
