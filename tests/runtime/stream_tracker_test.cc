// The stream tracker on a synthetic room: drift, relocalisation, darkness.
#include "plumb/runtime/stream_tracker.h"

#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/features/lsd_detector.h"
#include "plumb/features/segment_refiner.h"
#include "support/wall_scene.h"

namespace plumb {
namespace {

using testing::WallScene;

constexpr int kNumFrames = 12;

Rigid3 TruePose(int i) {
  const Eigen::Vector3d centre(0.012 * i - 0.06, 0.008 * i, 0.03);
  const Eigen::Quaterniond rotation = ExpSo3({0.01, 0.17 + 0.006 * i, -0.01});
  return {rotation, -(rotation * centre)};
}

class StreamTrackerTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const auto detector = CreateLsdDetector();
    SegmentRefiner refiner({});
    for (int i = 0; i < kNumFrames; ++i) {
      const auto image = Scene().Render(TruePose(i));
      Result<std::vector<Segment2>> raw = detector->Detect(image.View());
      ASSERT_TRUE(raw);
      Segments().push_back(refiner.Refine(image.View(), *raw));
    }
  }
  static const WallScene& Scene() {
    static const WallScene scene;
    return scene;
  }
  static std::vector<std::vector<Segment2>>& Segments() {
    static std::vector<std::vector<Segment2>> segments;
    return segments;
  }

  StreamTrackerTest() {
    Result<std::unique_ptr<PoseRefiner>> refiner = PoseRefiner::Create(index_, {});
    if (refiner) refiner_ = *std::move(refiner);
    tracker_.emplace(refiner_.get());
  }

  RefineInput Input(int i, const Rigid3& tracker_pose) {
    RefineInput input;
    input.camera = Scene().camera;
    input.segments = Segments()[static_cast<size_t>(i)];
    input.prior.cam_from_world = tracker_pose;
    input.seed = static_cast<uint64_t>(i);
    return input;
  }
  // Position error of the result [m].
  double Track(int i, const Rigid3& tracker_pose) {
    EXPECT_TRUE(tracker_->Track(Input(i, tracker_pose), &result_));
    return DistanceBetween(result_.cam_from_world, TruePose(i)).position_m;
  }

  const LineMap map_ = Scene().MakeMap(WallScene::KeyFramePoses());
  const MapIndex index_{map_};
  std::unique_ptr<PoseRefiner> refiner_;
  std::optional<StreamTracker> tracker_;
  RefineResult result_;
};

// A tracker whose world slides away by 4 mm and 0.1 deg a frame, and has done so before.
Rigid3 Drifting(int i) {
  const Rigid3 drift{ExpSo3({0.0, 0.0017 * (i + 5), 0.0008 * (i + 5)}),
                     Eigen::Vector3d(0.003, 0.002, 0.002) * (i + 5)};
  return TruePose(i) * drift;
}

TEST_F(StreamTrackerTest, DriftIsCorrectedWithoutASearch) {
  for (int i = 0; i < kNumFrames; ++i) {
    EXPECT_LT(Track(i, Drifting(i)), 0.01) << i;
    EXPECT_EQ(tracker_->searched(), i == 0) << i;
    EXPECT_EQ(result_.status, RefineStatus::kRefined) << i;
  }
}

TEST_F(StreamTrackerTest, FrameWithoutLinesKeepsTheCorrectionAndIsForgiven) {
  Vector6d offset;
  offset << 0.01, -0.01, 0.0, 0.03, 0.0, -0.02;
  for (int i = 0; i < kNumFrames; ++i) {
    const Rigid3 tracker_pose = Perturb(TruePose(i), offset);
    if (i == 4 || i == 5) {
      RefineInput dark = Input(i, tracker_pose);
      dark.segments = {};
      ASSERT_TRUE(tracker_->Track(dark, &result_));
      EXPECT_EQ(result_.status, RefineStatus::kLowSupport);
      // Not the tracker's pose, which is 3.6 cm off.
      EXPECT_LT(DistanceBetween(result_.cam_from_world, TruePose(i)).position_m, 0.015);
      EXPECT_TRUE(tracker_->searched());
      EXPECT_EQ(tracker_->state().frames_without_success, static_cast<uint32_t>(i - 3));
    } else {
      EXPECT_LT(Track(i, tracker_pose), 0.01) << i;
    }
  }
  EXPECT_EQ(tracker_->state().frames_without_success, 0u);
}

TEST_F(StreamTrackerTest, ComesBackAfterTheHostRelocalised) {
  // The tracker is 60 cm off and carried by the correction; then it knows where it is, at once.
  Vector6d lost;
  lost << 0.2, -0.25, 0.1, 0.4, 0.3, -0.3;
  Track(0, Perturb(TruePose(0), lost));
  int frames = 0;
  double error = 1.0;
  for (int i = 1; i < kNumFrames && error > 0.01; ++i, ++frames) error = Track(i, TruePose(i));
  EXPECT_LT(error, 0.01);
  EXPECT_LE(frames, 3);
}

TEST_F(StreamTrackerTest, AskMorePriorsWhenTheStreamIsLost) {
  Vector6d lost;
  lost << 0.3, -0.35, 0.3, 0.7, 0.6, -0.5;
  const std::vector<PosePrior> hits = {{Perturb(TruePose(0), lost)}, {TruePose(0)}};
  RefineInput first = Input(0, Perturb(TruePose(0), lost));
  ASSERT_TRUE(tracker_->Track(first, &result_));
  EXPECT_NE(result_.status, RefineStatus::kRefined) << "without them";
  tracker_.emplace(refiner_.get());
  first.more_priors = hits;
  ASSERT_TRUE(tracker_->Track(first, &result_));
  EXPECT_EQ(ToString(result_.status), "REFINED");
  EXPECT_EQ(result_.prior_index, 2u);
  EXPECT_LT(DistanceBetween(result_.cam_from_world, TruePose(0)).position_m, 0.01);
  // The correction is carried on, and nobody is asked while it holds.
  for (int i = 1; i < 4; ++i) {
    RefineInput next = Input(i, Perturb(TruePose(i), lost));
    next.more_priors = hits;
    ASSERT_TRUE(tracker_->Track(next, &result_));
    EXPECT_LT(DistanceBetween(result_.cam_from_world, TruePose(i)).position_m, 0.01) << i;
    EXPECT_FALSE(tracker_->searched()) << i;
    EXPECT_EQ(result_.prior_index, 0u);
  }
}

// One pose of the tracker is far off, and the next one is right again: a blunder, not a
// relocalisation. The frame itself may be lost, the stream must not be.
TEST_F(StreamTrackerTest, SurvivesAnOutlierOfTheTracker) {
  for (int i = 0; i < 5; ++i) Track(i, Drifting(i));
  const Rigid3 blunder{ExpSo3({0.0, 0.5, 0.1}), Eigen::Vector3d(1.0, -0.5, 0.7)};
  const double at_blunder = Track(5, Drifting(5) * blunder);
  EXPECT_TRUE(at_blunder < 0.01 || result_.status != RefineStatus::kRefined) << at_blunder;
  Track(6, Drifting(6));
  for (int i = 7; i < kNumFrames; ++i) {
    EXPECT_LT(Track(i, Drifting(i)), 0.01) << "frame " << i;
    EXPECT_EQ(ToString(result_.status), "REFINED") << "frame " << i;
  }
}

TEST_F(StreamTrackerTest, ErrorLeavesTheStreamAsItWas) {
  Track(0, TruePose(0));
  const StreamState before = tracker_->state();
  Rigid3 broken = TruePose(1);
  broken.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(tracker_->Track(Input(1, broken), &result_));
  EXPECT_EQ(tracker_->state().mean_support, before.mean_support);
  EXPECT_LT(Track(2, TruePose(2)), 0.01);
}

TEST_F(StreamTrackerTest, HoursOfDarknessEnd) {
  // A prediction that grows without an end would be no valid prior after 2,000 frames.
  tracker_.emplace(refiner_.get(), StreamOptions{.rotation_sigma_rad = 0.07});
  EXPECT_LT(Track(0, TruePose(0)), 0.01);
  RefineInput dark = Input(1, TruePose(1));
  dark.segments = {};
  for (int i = 0; i < 3000; ++i) ASSERT_TRUE(tracker_->Track(dark, &result_)) << "frame " << i;
  EXPECT_LT(Track(2, TruePose(2)), 0.01);
  EXPECT_EQ(ToString(result_.status), "REFINED");
}

TEST_F(StreamTrackerTest, ATimeBudgetIsTheFramesNotEachAttempts) {
  Vector6d lost;
  lost << 0.2, -0.25, 0.1, 0.4, 0.3, -0.3;
  const auto hypotheses_of_a_lost_frame = [&](int64_t time_budget_ns) {
    Result<std::unique_ptr<PoseRefiner>> refiner =
        PoseRefiner::Create(index_, {.time_budget_ns = time_budget_ns});
    StreamTracker tracker(refiner->get());
    EXPECT_TRUE(tracker.Track(Input(0, TruePose(0)), &result_));
    EXPECT_TRUE(tracker.Track(Input(1, Perturb(TruePose(1), lost)), &result_));
    EXPECT_TRUE(tracker.searched());
    EXPECT_EQ(result_.stages.out_of_time, time_budget_ns > 0);
    EXPECT_GE(result_.total_ns, result_.search_ns + result_.match_and_refine_ns);
    return result_.stages.num_hypotheses;
  };
  EXPECT_GE(hypotheses_of_a_lost_frame(0), 1000u) << "two searches";
  EXPECT_LE(hypotheses_of_a_lost_frame(1), 96u) << "the least of one";
}

}  // namespace
}  // namespace plumb
