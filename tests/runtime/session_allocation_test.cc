// The frame path of a session allocates nothing of its own once it is warm.
#include <algorithm>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/features/lsd_detector.h"
#include "plumb/runtime/session.h"
#include "support/allocation_counter.h"
#include "support/wall_scene.h"

namespace plumb {
namespace {

using testing::WallScene;

// Gives the segments that LSD found once: one allocation a frame, which the interface demands.
class StoredDetector : public LineDetector {
 public:
  explicit StoredDetector(std::vector<Segment2> segments) : segments_(std::move(segments)) {}
  Status Submit(const ImageView&) override { return Ok(); }
  Result<std::vector<Segment2>> Collect() override { return segments_; }
  std::string Name() const override { return "lsd"; }

 private:
  const std::vector<Segment2> segments_;
};

void ExpectOneAllocationAFrame(SessionMode mode) {
  // A frame or result buffer is warm once it was used, and which ones are used depends on the
  // threads' timing: of some runs of frames one must allocate nothing else.
  constexpr int kMaxRuns = 20, kNumFrames = 20;
  const WallScene scene;
  const LineMap map = scene.MakeMap(WallScene::KeyFramePoses());
  const MapIndex index(map);
  const Rigid3 truth{ExpSo3({0.01, 0.2, -0.01}), Eigen::Vector3d(0.03, 0.0, -0.02)};
  const auto image = scene.Render(truth);
  Result<std::vector<Segment2>> segments = CreateLsdDetector()->Detect(image.View());
  ASSERT_TRUE(segments);
  SessionOptions options;
  options.mode = mode;
  options.policy = FramePolicy::kBlock;
  Result<std::unique_ptr<Session>> session =
      Session::Create(index, std::make_unique<StoredDetector>(*std::move(segments)), options);
  ASSERT_TRUE(session);

  Vector6d error;
  error << 0.004, -0.003, 0.002, 0.006, -0.005, 0.004;
  SessionFrame frame;
  frame.image = image.View();
  frame.camera = scene.camera;
  frame.prior.cam_from_world = Perturb(truth, error);
  FrameResult result;
  size_t fewest = std::numeric_limits<size_t>::max();
  for (int run = 0; run < kMaxRuns && fewest > kNumFrames; ++run) {
    const size_t before = testing::num_allocations;
    for (int i = 0; i < kNumFrames; ++i) {
      ++frame.timestamp_ns;
      ASSERT_TRUE((*session)->Submit(frame));
      ASSERT_TRUE((*session)->Wait(60'000'000'000, &result));
      ASSERT_EQ(result.refined.status, RefineStatus::kRefined);
    }
    fewest = std::min<size_t>(fewest, testing::num_allocations - before);
  }
  EXPECT_EQ(fewest, static_cast<size_t>(kNumFrames));
}

TEST(SessionAllocations, StreamAllocatesForTheDetectorOnly) {
  ExpectOneAllocationAFrame(SessionMode::kStream);
}

TEST(SessionAllocations, IndependentFramesAllocateForTheDetectorOnly) {
  ExpectOneAllocationAFrame(SessionMode::kIndependent);
}

TEST(SessionAllocations, WithoutMemoryAFrameFailsAndTheNextOneWorks) {
  const WallScene scene;
  const LineMap map = scene.MakeMap(WallScene::KeyFramePoses());
  const MapIndex index(map);
  const Rigid3 truth{ExpSo3({0.01, 0.2, -0.01}), Eigen::Vector3d(0.03, 0.0, -0.02)};
  const auto image = scene.Render(truth);
  Result<std::unique_ptr<Session>> session = Session::Create(index, CreateLsdDetector(), {});
  ASSERT_TRUE(session);
  SessionFrame frame;
  frame.image = image.View();
  frame.camera = scene.camera;
  frame.prior.cam_from_world = truth;
  testing::has_memory = true;
  for (const bool memory_is_out : {true, true, false}) {
    testing::memory_is_out = memory_is_out;
    ++frame.timestamp_ns;
    const Result<SubmitOutcome> submitted = (*session)->Submit(frame);
    FrameResult result;
    const bool has_result = (*session)->Wait(60'000'000'000, &result);
    testing::memory_is_out = false;
    ASSERT_TRUE(submitted);
    ASSERT_TRUE(has_result);
    if (memory_is_out) {
      EXPECT_EQ(result.outcome, FrameOutcome::kFailed);
      EXPECT_EQ(result.error.code, ErrorCode::kOutOfMemory) << result.error.message;
    } else {
      EXPECT_EQ(result.outcome, FrameOutcome::kProcessed) << result.error.message;
    }
  }
}

}  // namespace
}  // namespace plumb
