// Taking over a host's frame: what is copied, what is borrowed, what is refused.
#include "plumb/runtime/frame_slot.h"

#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/runtime/session.h"

namespace plumb {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// An NV12 frame of 4 x 2 px with padded rows.
struct HostFrame {
  std::vector<uint8_t> luma = {1, 2, 3, 4, 99, 5, 6, 7, 8, 99};
  std::vector<uint8_t> chroma = {10, 11, 12, 13, 99, 99};
  int num_released = 0;
  SessionFrame frame;

  HostFrame() {
    frame.image.format = PixelFormat::kNv12;
    frame.image.width_px = 4;
    frame.image.height_px = 2;
    frame.image.planes[0] = {luma.data(), 5};
    frame.image.planes[1] = {chroma.data(), 6};
    frame.camera = Camera{4.0, 4.0, 1.5, 0.5, 4, 2};
    frame.timestamp_ns = 5;
  }
  void BorrowImage() {
    frame.release = [](void* user) { ++static_cast<HostFrame*>(user)->num_released; };
    frame.release_user = this;
  }
};

void ExpectRefused(const SessionFrame& frame, const std::string& name) {
  const Status status = ValidateFrame(frame);
  ASSERT_FALSE(status) << name;
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(status.error().message.find(name), std::string::npos) << status.error().message;
}

TEST(FrameSlot, CopiesEveryPlaneWithoutItsPadding) {
  HostFrame host;
  ASSERT_TRUE(ValidateFrame(host.frame));
  FrameSlot slot;
  slot.Assign(host.frame, *Rectifier::Create(host.frame.camera), 0);
  EXPECT_EQ(slot.pixels, (std::vector<uint8_t>{1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 13}));
  EXPECT_TRUE(slot.image.Validate());
  EXPECT_EQ(slot.image.planes[0].data, slot.pixels.data());
  EXPECT_EQ(slot.image.planes[1].data, slot.pixels.data() + 8);
  EXPECT_EQ(slot.image.planes[1].row_stride_bytes, 4);
}

TEST(FrameSlot, BorrowsTheImageThatComesWithARelease) {
  HostFrame host;
  host.BorrowImage();
  FrameSlot slot;
  slot.Assign(host.frame, *Rectifier::Create(host.frame.camera), 0);
  EXPECT_EQ(slot.image.planes[0].data, host.luma.data());
  EXPECT_EQ(host.num_released, 0);
  slot.ReleaseImage();
  slot.ReleaseImage();
  EXPECT_EQ(host.num_released, 1);
}

TEST(FrameSlot, AssignKeepsPointsAndNormalisesTheRotation) {
  HostFrame host;
  const std::vector<PointMatch> points(3);
  host.frame.points = points;
  host.frame.prior.cam_from_world.rotation = Eigen::Quaterniond(1.0005, 0, 0, 0);
  ASSERT_TRUE(ValidateFrame(host.frame));
  FrameSlot slot;
  slot.Assign(host.frame, *Rectifier::Create(host.frame.camera), 0);
  EXPECT_EQ(slot.points.size(), 3u);
  EXPECT_DOUBLE_EQ(slot.ticket.prior.cam_from_world.rotation.norm(), 1.0);
}

TEST(FrameSlot, AssignKeepsTheOtherPriors) {
  HostFrame host;
  std::vector<PosePrior> more(2);
  more[1].cam_from_world.rotation = Eigen::Quaterniond(1.0005, 0, 0, 0);
  more[1].position_sigma_m = 0.7;
  host.frame.more_priors = more;
  ASSERT_TRUE(ValidateFrame(host.frame));
  FrameSlot slot;
  const auto rectifier = *Rectifier::Create(host.frame.camera);
  slot.Assign(host.frame, rectifier, 0);
  more.clear();  // They were borrowed.
  ASSERT_EQ(slot.more_priors.size(), 2u);
  EXPECT_DOUBLE_EQ(slot.more_priors[1].cam_from_world.rotation.norm(), 1.0);
  EXPECT_EQ(slot.more_priors[1].position_sigma_m, 0.7);
  host.frame.more_priors = {};
  slot.Assign(host.frame, rectifier, 0);
  EXPECT_TRUE(slot.more_priors.empty());
}

TEST(ValidateFrame, NamesWhatIsBroken) {
  HostFrame host;
  SessionFrame frame = host.frame;
  frame.image.planes[1].row_stride_bytes = 3;
  ExpectRefused(frame, "planes[1].row_stride_bytes 3");
  frame = host.frame;
  frame.camera.pinhole.fx = 0.0;
  ExpectRefused(frame, "camera");
  frame = host.frame;
  frame.camera.pinhole.width_px = 8;
  ExpectRefused(frame, "camera is for 8 x 2 px");
  frame = host.frame;
  frame.prior.cam_from_world.translation.x() = kNan;
  ExpectRefused(frame, "prior: translation (nan, 0, 0) is not finite");
  frame = host.frame;
  frame.prior.cam_from_world.rotation.coeffs() *= 1.01;
  ExpectRefused(frame, "not a finite unit quaternion");
  frame = host.frame;
  frame.prior.position_sigma_m = 0.0;
  ExpectRefused(frame, "prior.position_sigma_m");
  frame = host.frame;
  frame.prior.rotation_sigma_rad = kNan;
  ExpectRefused(frame, "prior.rotation_sigma_rad");
  frame = host.frame;
  frame.prior.position_sigma_m = 2000.0;
  ExpectRefused(frame, "prior.position_sigma_m 2000 is not in [1e-9, 1000]");
  std::vector<PosePrior> more(2);
  frame = host.frame;
  frame.more_priors = more;
  more[1].rotation_sigma_rad = -0.25;
  ExpectRefused(frame, "more_priors[1].rotation_sigma_rad -0.25");
  more[0].cam_from_world.translation.z() = kNan;
  ExpectRefused(frame, "more_priors[0]: translation (0, 0, nan)");
  more.assign(kMaxMorePriors + 1, PosePrior{});
  frame.more_priors = more;
  ExpectRefused(frame, "more_priors has 9 entries, more than 8");
  std::vector<PointMatch> points(2);
  points[1].pixel.x() = kNan;
  frame = host.frame;
  frame.points = points;
  ExpectRefused(frame, "points[1]");
  points[1].pixel.x() = 2e6;
  ExpectRefused(frame, "points[1] at (2e+06, 0) is not in pixels of an image");
}

}  // namespace
}  // namespace plumb
