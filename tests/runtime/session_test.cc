// Sessions over a synthetic room: order, policies, deadlines, failures, and that poses get better.
#include "plumb/runtime/session.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/features/lsd_detector.h"
#include "support/wall_scene.h"

namespace plumb {
namespace {

using testing::GrayImage;
using testing::WallScene;

constexpr int64_t kSecondNs = 1'000'000'000;

Rigid3 TruePose(int i) {
  const Eigen::Vector3d centre(0.02 * i - 0.05, 0.01 * i, 0.03);
  const Eigen::Quaterniond rotation = ExpSo3({0.01, 0.2 + 0.01 * i, -0.01});
  return {rotation, -(rotation * centre)};
}

// Map, index and images that every test shares; images are rendered once.
struct Room {
  const WallScene scene;
  const LineMap map = scene.MakeMap(WallScene::KeyFramePoses());
  const MapIndex index{map};

  const GrayImage& Image(int i) {
    const auto found = images.find(i);
    if (found != images.end()) return found->second;
    return images.emplace(i, scene.Render(TruePose(i))).first->second;
  }
  SessionFrame Frame(int i, const Vector6d& prior_error) {
    SessionFrame frame;
    frame.image = Image(i).View();
    frame.camera = scene.camera;
    frame.timestamp_ns = (i + 1) * 33'000'000LL;
    frame.prior.cam_from_world = Perturb(TruePose(i), prior_error);
    frame.user_tag = static_cast<uint64_t>(1000 + i);
    return frame;
  }

  std::map<int, GrayImage> images;
};

Room& TheRoom() {
  static Room room;
  return room;
}

// 4 cm, 1.2 deg.
Vector6d PriorError() {
  Vector6d error;
  error << 0.015, -0.012, 0.008, 0.025, -0.02, 0.024;
  return error;
}

// LSD that starts when it is told to, counts, and fails on request.
class GatedDetector : public LineDetector {
 public:
  struct Control {
    std::mutex mutex;
    std::condition_variable changed;
    int num_allowed = 1 << 30;
    int num_submitted = 0, num_collected = 0;
    bool is_in_background = false;
    ErrorCode error = ErrorCode::kInternal;
    bool fails = false, is_stuck = false, is_out_of_memory = false;

    void Allow(int count) {
      const std::scoped_lock lock(mutex);
      num_allowed = count;
      changed.notify_all();
    }
    void AwaitSubmitted(int count) {
      std::unique_lock lock(mutex);
      changed.wait(lock, [&] { return num_submitted >= count; });
    }
  };

  explicit GatedDetector(std::shared_ptr<Control> control) : control_(std::move(control)) {}

  Status Submit(const ImageView& image) override {
    {
      const std::scoped_lock lock(control_->mutex);
      ++control_->num_submitted;
      control_->changed.notify_all();
      if (control_->fails) return Error{control_->error, "planted failure"};
    }
    return lsd_->Submit(image);
  }
  Result<std::vector<Segment2>> Collect() override {
    {
      std::unique_lock lock(control_->mutex);
      ++control_->num_collected;
      control_->changed.wait(lock,
                             [&] { return control_->num_collected <= control_->num_allowed; });
      if (control_->is_stuck) return Error{ErrorCode::kInternal, "no answer in time"};
      if (std::exchange(control_->is_out_of_memory, false)) {
        (void)lsd_->Collect();
        throw std::bad_alloc();
      }
    }
    return lsd_->Collect();
  }
  bool WorksInBackground() const override { return control_->is_in_background; }
  std::string Name() const override { return "lsd"; }

 private:
  const std::shared_ptr<Control> control_;
  const std::unique_ptr<LineDetector> lsd_ = CreateLsdDetector();
};

class SessionTest : public ::testing::Test {
 protected:
  void Start(const SessionOptions& options) {
    Result<std::unique_ptr<Session>> session =
        Session::Create(TheRoom().index, std::make_unique<GatedDetector>(control_), options);
    ASSERT_TRUE(session) << session.error().message;
    session_ = *std::move(session);
  }
  SubmitOutcome Submit(int i) {
    const Result<SubmitOutcome> outcome = session_->Submit(TheRoom().Frame(i, PriorError()));
    EXPECT_TRUE(outcome);
    return outcome ? *outcome : SubmitOutcome::kTimedOut;
  }
  FrameResult Next() {
    FrameResult result;
    EXPECT_TRUE(session_->Wait(60 * kSecondNs, &result));
    return result;
  }

  const std::shared_ptr<GatedDetector::Control> control_ =
      std::make_shared<GatedDetector::Control>();
  std::unique_ptr<Session> session_;
};

SessionOptions Blocking(SessionMode mode = SessionMode::kIndependent) {
  SessionOptions options;
  options.policy = FramePolicy::kBlock;
  options.mode = mode;
  return options;
}

TEST_F(SessionTest, RefinesAPoseFromItsImage) {
  Start(Blocking());
  Submit(0);
  const FrameResult result = Next();
  ASSERT_EQ(result.outcome, FrameOutcome::kProcessed) << result.error.message;
  EXPECT_EQ(result.refined.status, RefineStatus::kRefined);
  const PoseDistance error = DistanceBetween(result.refined.cam_from_world, TruePose(0));
  EXPECT_LT(error.position_m, 0.01);
  EXPECT_LT(error.rotation_rad, 0.003);
  EXPECT_EQ(result.user_tag, 1000u);
  EXPECT_TRUE(result.searched);
  EXPECT_GT(result.segments.size(), 20u);
  EXPECT_GT(result.refined.matches.size(), 10u);
}

// A metre and half a radian away from where frame `i` was taken.
Rigid3 FarFrom(int i) {
  Vector6d error;
  error << 0.3, -0.3, 0.3, 0.6, -0.6, 0.5;
  return Perturb(TruePose(i), error);
}

TEST_F(SessionTest, TheRightOneOfSeveralPriorsIsRefined) {
  Start(Blocking());
  SessionFrame frame = TheRoom().Frame(0, PriorError());
  const std::vector<PosePrior> more = {{FarFrom(0)}, frame.prior};
  frame.prior.cam_from_world = FarFrom(0);
  frame.more_priors = more;
  ASSERT_TRUE(session_->Submit(frame));
  Submit(1);  // The next frame has one prior again.
  FrameResult result = Next();
  EXPECT_EQ(result.refined.status, RefineStatus::kRefined);
  EXPECT_EQ(result.refined.prior_index, 2u);
  EXPECT_LT(DistanceBetween(result.refined.cam_from_world, TruePose(0)).position_m, 0.01);
  EXPECT_EQ(result.prior.cam_from_world.translation, FarFrom(0).translation);
  result = Next();
  EXPECT_EQ(result.refined.status, RefineStatus::kRefined);
  EXPECT_EQ(result.refined.prior_index, 0u);
}

TEST_F(SessionTest, ThePapersMethodRefusesSeveralPriors) {
  SessionOptions options = Blocking();
  options.refiner.method = RefineMethod::kPaper;
  Start(options);
  SessionFrame frame = TheRoom().Frame(0, PriorError());
  const std::vector<PosePrior> more = {frame.prior};
  frame.more_priors = more;
  const Result<SubmitOutcome> outcome = session_->Submit(frame);
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(outcome.error().message.find("more_priors has 1 entries"), std::string::npos);
}

TEST_F(SessionTest, TimesOfTheStagesAddUp) {
  Start(Blocking());
  Submit(0);
  const StageTimes times = Next().times;
  EXPECT_GT(times.detect_ns, 0);
  EXPECT_GT(times.ridge_ns, 0);
  EXPECT_GT(times.match_and_refine_ns, 0);
  EXPECT_GE(times.total_ns, times.wait_ns + times.detect_ns + times.ridge_ns);
}

TEST_F(SessionTest, BlockingSessionGivesEveryFrameInItsOrder) {
  for (const bool in_background : {false, true}) {
    control_->is_in_background = in_background;
    Start(Blocking());
    for (int i = 0; i < 6; ++i) EXPECT_EQ(Submit(i), SubmitOutcome::kAccepted);
    for (uint64_t i = 0; i < 6; ++i) {
      const FrameResult result = Next();
      EXPECT_EQ(result.frame_index, i);
      EXPECT_EQ(result.outcome, FrameOutcome::kProcessed);
    }
    const SessionStats stats = session_->Stats();
    EXPECT_EQ(stats.submitted, 6u);
    EXPECT_EQ(stats.completed, 6u);
  }
}

TEST_F(SessionTest, BackgroundDetectorGetsTheNextFrameBeforeThisOneIsRefined) {
  control_->is_in_background = true;
  control_->Allow(0);
  std::vector<int> submitted_at_result;
  SessionOptions options = Blocking();
  std::atomic<int> num_results{0};
  options.on_result = [&](const FrameResult&) {
    {
      const std::scoped_lock lock(control_->mutex);
      submitted_at_result.push_back(control_->num_submitted);
    }
    ++num_results;
  };
  Start(options);
  Submit(0);
  control_->AwaitSubmitted(1);
  Submit(1);  // waits while the detector is at the first
  control_->Allow(2);
  while (num_results < 2) std::this_thread::yield();
  EXPECT_EQ(submitted_at_result, (std::vector<int>{2, 2}));
}

TEST_F(SessionTest, NewestFrameReplacesTheWaitingOneWhichIsReportedInOrder) {
  control_->Allow(0);
  Start({});
  EXPECT_EQ(Submit(0), SubmitOutcome::kAccepted);
  control_->AwaitSubmitted(1);
  EXPECT_EQ(Submit(1), SubmitOutcome::kAccepted);
  EXPECT_EQ(Submit(2), SubmitOutcome::kReplacedFrame);
  EXPECT_EQ(Submit(3), SubmitOutcome::kReplacedFrame);
  control_->Allow(2);
  const FrameOutcome expected[] = {FrameOutcome::kProcessed, FrameOutcome::kDropped,
                                   FrameOutcome::kDropped, FrameOutcome::kProcessed};
  for (uint64_t i = 0; i < 4; ++i) {
    const FrameResult result = Next();
    EXPECT_EQ(result.frame_index, i);
    EXPECT_EQ(result.user_tag, 1000 + i);
    EXPECT_EQ(result.outcome, expected[i]);
    if (result.outcome == FrameOutcome::kDropped) {
      const Rigid3 prior = Perturb(TruePose(static_cast<int>(i)), PriorError());
      EXPECT_LT(DistanceBetween(result.refined.cam_from_world, prior).position_m, 1e-9);
      EXPECT_TRUE(result.segments.empty());
    }
  }
  EXPECT_EQ(session_->Stats().dropped, 2u);
}

TEST_F(SessionTest, ReleaseOfAReplacedFrameMaySubmitTheNextOne) {
  control_->Allow(0);
  Start({});
  EXPECT_EQ(Submit(0), SubmitOutcome::kAccepted);
  control_->AwaitSubmitted(1);
  struct Host {
    Session* session;
    int num_submitted;
  } host{session_.get(), 1};
  struct Release {
    static void Call(void* user) {
      Host* to = static_cast<Host*>(user);
      if (to->num_submitted >= 8) return;
      SessionFrame frame = TheRoom().Frame(to->num_submitted++, PriorError());
      frame.release = &Release::Call;
      frame.release_user = to;
      EXPECT_TRUE(to->session->Submit(frame));
    }
  };
  Release::Call(&host);
  Release::Call(&host);  // replaces the one before, whose release submits, and so on
  EXPECT_EQ(host.num_submitted, 8);
  EXPECT_EQ(session_->Stats().submitted, 8u);
  control_->Allow(1 << 30);
  for (uint64_t i = 0; i < 8; ++i) EXPECT_EQ(Next().frame_index, i);
  session_.reset();
}

TEST_F(SessionTest, BlockingSubmitTimesOut) {
  control_->Allow(0);
  SessionOptions options = Blocking();
  options.submit_timeout_ns = 1'000'000;
  Start(options);
  EXPECT_EQ(Submit(0), SubmitOutcome::kAccepted);
  control_->AwaitSubmitted(1);
  EXPECT_EQ(Submit(1), SubmitOutcome::kAccepted);
  EXPECT_EQ(Submit(2), SubmitOutcome::kTimedOut);
  control_->Allow(10);
  EXPECT_EQ(Next().frame_index, 0u);
  EXPECT_EQ(Next().frame_index, 1u);
  // Not accepted means not seen: the same time stamp may come again.
  EXPECT_EQ(Submit(2), SubmitOutcome::kAccepted);
  EXPECT_EQ(Next().frame_index, 2u);
}

TEST_F(SessionTest, LateFrameReturnsItsPrior) {
  control_->Allow(0);
  SessionOptions options = Blocking();
  options.deadline_ns = 1'000'000;
  Start(options);
  Submit(0);
  std::this_thread::sleep_for(std::chrono::milliseconds(3));
  control_->Allow(1);
  const FrameResult result = Next();
  EXPECT_EQ(result.outcome, FrameOutcome::kLate);
  EXPECT_LT(
      DistanceBetween(result.refined.cam_from_world, Perturb(TruePose(0), PriorError())).position_m,
      1e-9);
  EXPECT_EQ(session_->Stats().late, 1u);
}

TEST_F(SessionTest, StreamCarriesTheCorrectionWithoutSearching) {
  Start(Blocking(SessionMode::kStream));
  for (int i = 0; i < 6; ++i) {
    Submit(i);
    const FrameResult result = Next();
    ASSERT_EQ(result.outcome, FrameOutcome::kProcessed);
    EXPECT_EQ(result.searched, i == 0) << i;
    const PoseDistance error = DistanceBetween(result.refined.cam_from_world, TruePose(i));
    EXPECT_LT(error.position_m, 0.01) << i;
    EXPECT_LT(error.rotation_rad, 0.003) << i;
  }
}

TEST_F(SessionTest, StreamSearchesAfterATrackerJump) {
  Start(Blocking(SessionMode::kStream));
  for (int i = 0; i < 3; ++i) {
    Submit(i);
    Next();
  }
  // 18 cm and 5 deg away from where the frames before say it is.
  Vector6d jump = PriorError();
  jump += (Vector6d() << -0.05, 0.06, 0.03, 0.10, 0.12, -0.08).finished();
  ASSERT_TRUE(session_->Submit(TheRoom().Frame(3, jump)));
  const FrameResult result = Next();
  EXPECT_TRUE(result.searched);
  EXPECT_LT(DistanceBetween(result.refined.cam_from_world, TruePose(3)).position_m, 0.02);
}

TEST_F(SessionTest, FailedFrameSaysWhyAndTheNextOneWorks) {
  control_->fails = true;
  Start(Blocking());
  Submit(0);
  const FrameResult failed = Next();
  EXPECT_EQ(failed.outcome, FrameOutcome::kFailed);
  EXPECT_EQ(failed.error.message, "planted failure");
  {
    const std::scoped_lock lock(control_->mutex);
    control_->fails = false;
  }
  Submit(1);
  EXPECT_EQ(Next().outcome, FrameOutcome::kProcessed);
}

TEST_F(SessionTest, LostDeviceRefusesFurtherFrames) {
  control_->fails = true;
  control_->error = ErrorCode::kDeviceLost;
  Start(Blocking());
  Submit(0);
  EXPECT_EQ(Next().error.code, ErrorCode::kDeviceLost);
  const Result<SubmitOutcome> refused = session_->Submit(TheRoom().Frame(1, PriorError()));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kDeviceLost);
}

TEST_F(SessionTest, DeviceThatDoesNotAnswerIsLost) {
  control_->is_in_background = true;
  control_->is_stuck = true;
  Start(Blocking());
  Submit(0);
  EXPECT_EQ(Next().error.message, "no answer in time");
  const Result<SubmitOutcome> refused = session_->Submit(TheRoom().Frame(1, PriorError()));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kDeviceLost);
}

TEST_F(SessionTest, DeviceThatAnsweredIsNotLostForWantOfMemory) {
  control_->is_in_background = true;
  control_->is_out_of_memory = true;
  Start(Blocking());
  Submit(0);
  const FrameResult result = Next();
  EXPECT_EQ(result.outcome, FrameOutcome::kFailed);
  EXPECT_EQ(result.error.code, ErrorCode::kOutOfMemory);
  Submit(1);
  EXPECT_EQ(Next().outcome, FrameOutcome::kProcessed);
}

TEST_F(SessionTest, TimestampsMustIncrease) {
  Start(Blocking());
  Submit(1);
  const Result<SubmitOutcome> refused = session_->Submit(TheRoom().Frame(1, PriorError()));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().message.find("timestamp_ns"), std::string::npos);
  EXPECT_EQ(session_->Stats().submitted, 1u);
}

TEST_F(SessionTest, DestructionWithFramesInsideReleasesEveryImage) {
  for (const bool in_background : {false, true}) {
    control_->is_in_background = in_background;
    control_->num_submitted = control_->num_collected = 0;
    control_->Allow(0);
    Start({});
    std::atomic<int> num_released{0};
    const auto submit = [&](int i) {
      SessionFrame frame = TheRoom().Frame(i, PriorError());
      frame.release = [](void* user) { ++*static_cast<std::atomic<int>*>(user); };
      frame.release_user = &num_released;
      EXPECT_TRUE(session_->Submit(frame));
    };
    submit(0);
    control_->AwaitSubmitted(1);
    submit(1);
    submit(2);
    EXPECT_EQ(num_released, 1);  // of the replaced frame
    std::thread opener([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      control_->Allow(1 << 30);
    });
    session_.reset();
    opener.join();
    EXPECT_EQ(num_released, 3);
  }
}

TEST_F(SessionTest, DestructionWithoutAnyFrameReturns) {
  Start({});
  session_.reset();
  Start(Blocking(SessionMode::kStream));
}

TEST(SessionWithACorrectedCamera, TakesItsFramesByTheCorrectedOne) {
  Room& room = TheRoom();
  LineMap map = room.map;
  ImageCamera given = room.scene.camera;
  given.pinhole.fx *= 1.02;
  given.pinhole.fy *= 1.02;
  map.camera_correction = CameraCorrection{given, room.scene.camera};
  const MapIndex index(map);
  const auto refine = [&room](const MapIndex& of_map, const ImageCamera& camera) {
    auto session = Session::Create(of_map, CreateLsdDetector(), {});
    SessionFrame frame = room.Frame(0, PriorError());
    frame.camera = camera;
    EXPECT_TRUE(session && (*session)->Submit(frame));
    FrameResult result;
    EXPECT_TRUE((*session)->Wait(60 * kSecondNs, &result));
    return result.refined.cam_from_world;
  };
  const Rigid3 right = refine(room.index, room.scene.camera);
  const Rigid3 corrected = refine(index, given), wrong = refine(room.index, given);
  EXPECT_EQ(corrected.translation, right.translation);
  EXPECT_EQ(corrected.rotation.coeffs(), right.rotation.coeffs());
  EXPECT_GT((wrong.Center() - right.Center()).norm(), 0.01);
  // Another camera than the one that took the key frames is taken as it is.
  EXPECT_EQ(refine(index, room.scene.camera).translation, right.translation);
}

TEST_F(SessionTest, EqualFramesGiveEqualBytes) {
  Rigid3 poses[2];
  for (Rigid3& pose : poses) {
    Start(Blocking());
    Submit(0);
    pose = Next().refined.cam_from_world;
  }
  EXPECT_EQ(poses[0].translation, poses[1].translation);
  EXPECT_EQ(poses[0].rotation.coeffs(), poses[1].rotation.coeffs());
}

TEST(SessionOptions, ValidateNamesTheMemberOutOfRange) {
  EXPECT_TRUE(SessionOptions{}.Validate());
  const auto message = [](auto&& change) {
    SessionOptions options;
    change(&options);
    const Status status = options.Validate();
    return status ? std::string() : status.error().message;
  };
  EXPECT_NE(message([](SessionOptions* o) { o->result_capacity = 0; }).find("result_capacity 0"),
            std::string::npos);
  EXPECT_NE(message([](SessionOptions* o) { o->result_capacity = 2000; }).find("1..1024"),
            std::string::npos);
  EXPECT_NE(message([](SessionOptions* o) { o->deadline_ns = -1; }).find("deadline_ns"),
            std::string::npos);
  EXPECT_NE(
      message([](SessionOptions* o) { o->submit_timeout_ns = -5; }).find("submit_timeout_ns -5"),
      std::string::npos);
  EXPECT_NE(message([](SessionOptions* o) { o->refiner.num_hypotheses = 0; }).find("hypotheses"),
            std::string::npos);
  EXPECT_NE(
      message([](SessionOptions* o) { o->stream.position_sigma_m = -1; }).find("position_sigma_m"),
      std::string::npos);
}

TEST(Session, NeedsADetector) {
  const auto session = Session::Create(TheRoom().index, nullptr, {});
  ASSERT_FALSE(session);
  EXPECT_EQ(session.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace plumb
