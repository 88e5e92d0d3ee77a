// What a map's own key frames say about how much evidence a right pose has.
#include "plumb/runtime/expected_evidence.h"

#include <vector>

#include <gtest/gtest.h>

#include "plumb/runtime/pose_refiner.h"
#include "support/wall_scene.h"

namespace plumb {
namespace {

const testing::WallScene kScene;

LineMap Map() { return kScene.MakeMap(testing::WallScene::KeyFramePoses()); }

TEST(ExpectedEvidence, KeyFramesThatSeeTheirLinesHavePlenty) {
  const LineMap map = Map();
  const MapIndex index(map);
  ExpectedEvidence expected(index);
  const double least = expected.LeastNear(Rigid3{});
  EXPECT_GT(least, 50.0);
  EXPECT_EQ(expected.LeastNear(Rigid3{}), least);  // remembered
}

TEST(ExpectedEvidence, IsThatOfThePoorestKeyFrame) {
  LineMap map = Map();
  map.key_frames[2].segments.resize(4);
  const MapIndex index(map);
  ExpectedEvidence expected(index);
  const double near_poor = expected.LeastNear(map.key_frames[2].cam_from_world);
  const LineMap rich = Map();
  const MapIndex rich_index(rich);
  EXPECT_LT(near_poor,
            0.5 * ExpectedEvidence(rich_index).LeastNear(map.key_frames[2].cam_from_world));
}

TEST(ExpectedEvidence, AsksForNothingFarFromTheKeyFrames) {
  const LineMap map = Map();
  const MapIndex index(map);
  ExpectedEvidence expected(index);
  EXPECT_EQ(expected.LeastNear({Eigen::Quaterniond::Identity(), {3.0, 0.0, 0.0}}), 0.0);
  EXPECT_EQ(expected.LeastNear({ExpSo3({0.0, 2.0, 0.0}), Eigen::Vector3d::Zero()}), 0.0);
}

TEST(ExpectedEvidence, AsksForNothingWithFewerThanThreeKeyFrames) {
  const auto poses = testing::WallScene::KeyFramePoses();
  const LineMap map = kScene.MakeMap(std::span(poses).first(2));
  const MapIndex index(map);
  EXPECT_EQ(ExpectedEvidence(index).LeastNear(Rigid3{}), 0.0);
}

/// Refines a frame that shows every `stride`-th of its segments, from a prior that is off by 4 cm.
RefineResult RefineFewer(const LineMap& map, size_t stride) {
  const Rigid3 truth{ExpSo3({0.0, 0.2, 0.0}), Eigen::Vector3d::Zero()};
  const LineMap seen = kScene.MakeMap(std::span(&truth, 1));
  std::vector<Segment2> segments;
  for (size_t i = 0; i < seen.key_frames[0].segments.size(); i += stride) {
    segments.push_back(seen.key_frames[0].segments[i].segment_px);
  }
  const MapIndex index(map);
  const auto refiner = PoseRefiner::Create(index, {});
  RefineInput input;
  input.camera = kScene.camera;
  input.segments = segments;
  input.prior.cam_from_world = {truth.rotation, {0.03, 0.02, -0.02}};
  RefineResult result;
  EXPECT_TRUE((*refiner)->Refine(input, &result));
  return result;
}

TEST(ExpectedEvidence, APoseThatExplainsFarLessThanItsNeighboursIsRefused) {
  const LineMap map = Map();
  LineMap silent = map;  // nothing is known of what its key frames saw
  for (KeyFrame& frame : silent.key_frames) frame.segments.clear();
  EXPECT_EQ(ToString(RefineFewer(map, 1).status), "REFINED");
  EXPECT_EQ(ToString(RefineFewer(map, 2).status), "REFINED");
  // Enough to beat chance (the silent map only misses a direction), too little for this place.
  const RefineResult refused = RefineFewer(map, 4), accepted = RefineFewer(silent, 4);
  EXPECT_EQ(ToString(accepted.status), "DEGENERATE");
  EXPECT_EQ(ToString(refused.status), "LOW_SUPPORT");
  EXPECT_EQ(refused.evidence_nats, accepted.evidence_nats);
}

}  // namespace
}  // namespace plumb
