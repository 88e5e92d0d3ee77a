// Lifting segments with the depth beside them.
#include "plumb/map/lift.h"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "map/rendered_depth.h"

namespace plumb {
namespace {

constexpr Camera kCamera{300.0, 310.0, 159.5, 119.5, 320, 240};
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const Segment2 kVertical{{160.0, 60.0}, {160.0, 180.0}, 0.7};

std::vector<LiftedPart> Lift(const DepthImage& depth, const Segment2& segment,
                             const Camera& camera = kCamera) {
  return LiftSegments(camera, depth.View(), std::vector<Segment2>{segment});
}

DepthImage LeftRight(double left_m, double right_m) {
  return MakeDepth(kCamera, [=](int x, int) { return x < 160 ? left_m : right_m; });
}

// Roughly planar nowhere: a hash of the pixel picks the depth.
double Clutter(int x, int y, double near_m, double far_m) {
  const uint32_t hash =
      (static_cast<uint32_t>(x) * 73856093u) ^ (static_cast<uint32_t>(y) * 19349663u);
  return near_m + (far_m - near_m) * ((hash >> 4) % 997) / 996.0;
}

TEST(Lift, SegmentOnAWallGetsTheWallsDepth) {
  const auto lifted = Lift(LeftRight(2.5, 2.5), kVertical);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_EQ(lifted[0].source, 0u);
  EXPECT_NEAR(lifted[0].segment_in_cam.start.z(), 2.5, 1e-4);
  EXPECT_NEAR(lifted[0].segment_in_cam.end.z(), 2.5, 1e-4);
  EXPECT_NEAR((lifted[0].segment_px.start - kVertical.start).norm(), 0.0, 1e-9);
  EXPECT_NEAR((lifted[0].segment_px.end - kVertical.end).norm(), 0.0, 1e-9);
  EXPECT_EQ(lifted[0].segment_px.score, 0.7);
}

TEST(Lift, EndPointsLieOnTheRaysOfTheKeptPart) {
  const auto lifted = Lift(LeftRight(2.5, 2.5), {{40.5, 30.25}, {200.75, 201.0}});
  ASSERT_EQ(lifted.size(), 1u);
  const LiftedPart& part = lifted[0];
  EXPECT_LT((kCamera.Project(part.segment_in_cam.start) - part.segment_px.start).norm(), 1e-9);
  EXPECT_LT((kCamera.Project(part.segment_in_cam.end) - part.segment_px.end).norm(), 1e-9);
}

TEST(Lift, SlantedPlaneIsFollowedAlongTheSegment) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0.8, -0.2, -1.0).normalized();
  const Eigen::Vector3d anchor(0.0, 0.0, 2.0);
  const DepthImage depth = MakeDepth(kCamera, [&](int x, int y) {
    const Eigen::Vector2d at = kCamera.Normalize({x, y});
    return normal.dot(anchor) / normal.dot(Eigen::Vector3d(at.x(), at.y(), 1.0));
  });
  const auto lifted = Lift(depth, {{60.0, 50.0}, {250.0, 170.0}});
  ASSERT_EQ(lifted.size(), 1u);
  // Samples are read at whole pixels, hence not exact.
  EXPECT_NEAR(normal.dot(lifted[0].segment_in_cam.start - anchor), 0.0, 2e-3);
  EXPECT_NEAR(normal.dot(lifted[0].segment_in_cam.end - anchor), 0.0, 2e-3);
  EXPECT_GT(std::abs(lifted[0].segment_in_cam.Delta().z()), 0.5);
}

TEST(Lift, TheNearerSurfaceOwnsAnOccludingEdge) {
  for (const auto& [left, right] : {std::pair{1.0, 2.0}, std::pair{2.0, 1.0}}) {
    const auto lifted = Lift(LeftRight(left, right), kVertical);
    ASSERT_EQ(lifted.size(), 1u);
    EXPECT_NEAR(lifted[0].segment_in_cam.start.z(), 1.0, 1e-4);
    EXPECT_NEAR(lifted[0].segment_in_cam.end.z(), 1.0, 1e-4);
  }
}

TEST(Lift, DirectionOfTheSegmentDoesNotMatter) {
  const auto lifted = Lift(LeftRight(1.0, 2.0), {kVertical.end, kVertical.start});
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_NEAR(lifted[0].segment_in_cam.start.z(), 1.0, 1e-4);
  EXPECT_GT(lifted[0].segment_in_cam.start.y(), lifted[0].segment_in_cam.end.y());
}

TEST(Lift, TornDepthOnTheEdgeIsNotRead) {
  DepthImage depth = LeftRight(1.0, 2.0);
  for (int y = 0; y < depth.height_px; ++y) {
    for (int x = 159; x <= 161; ++x) depth.at(x, y) = static_cast<float>(Clutter(x, y, 0.3, 4.0));
  }
  const auto lifted = Lift(depth, kVertical);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_NEAR(lifted[0].segment_in_cam.Midpoint().z(), 1.0, 1e-3);
}

TEST(Lift, CreaseLiesWhereItsTwoPlanesMeet) {
  const DepthImage depth =
      MakeDepth(kCamera, [](int x, int) { return 1.0 / (0.5 - 0.004 * std::abs(x - 160.0)); });
  const auto lifted = Lift(depth, kVertical);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_NEAR(lifted[0].segment_in_cam.start.z(), 2.0, 5e-3);
  EXPECT_NEAR(lifted[0].segment_in_cam.end.z(), 2.0, 5e-3);
}

TEST(Lift, OneSideSufficesWhenTheOtherHasNoDepth) {
  for (const double nothing : {0.0, kNaN, std::numeric_limits<double>::infinity(), -1.0}) {
    const auto lifted = Lift(LeftRight(1.5, nothing), kVertical);
    ASSERT_EQ(lifted.size(), 1u) << nothing;
    EXPECT_NEAR(lifted[0].segment_in_cam.start.z(), 1.5, 1e-4);
  }
}

TEST(Lift, ClutterBehindDoesNotOwnTheEdge) {
  const DepthImage depth =
      MakeDepth(kCamera, [](int x, int y) { return x < 160 ? 1.0 : Clutter(x, y, 1.5, 4.0); });
  const auto lifted = Lift(depth, kVertical);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_NEAR(lifted[0].segment_in_cam.start.z(), 1.0, 1e-4);
}

TEST(Lift, NearerClutterMakesTheDepthUnknown) {
  const DepthImage depth =
      MakeDepth(kCamera, [](int x, int y) { return x < 160 ? 2.0 : Clutter(x, y, 0.4, 1.2); });
  EXPECT_TRUE(Lift(depth, kVertical).empty());
}

TEST(Lift, KeepsTheLongestRunOfDepth) {
  const DepthImage depth =
      MakeDepth(kCamera, [](int, int y) { return y < 130 || y >= 165 ? 2.0 : 0.0; });
  const auto lifted = Lift(depth, kVertical);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_NEAR(lifted[0].segment_px.start.y(), 60.0, 1e-9);
  EXPECT_NEAR(lifted[0].segment_px.end.y(), 130.0, 4.0);
}

TEST(Lift, BridgesShortHoles) {
  const DepthImage depth =
      MakeDepth(kCamera, [](int, int y) { return y < 120 || y >= 129 ? 2.0 : 0.0; });
  const auto lifted = Lift(depth, kVertical);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_NEAR(lifted[0].segment_px.Length(), kVertical.Length(), 1e-9);
}

TEST(Lift, NothingWithoutDepthInRange) {
  EXPECT_TRUE(Lift(LeftRight(0.0, 0.0), kVertical).empty());
  EXPECT_TRUE(Lift(LeftRight(0.1, 0.1), kVertical).empty());
  EXPECT_TRUE(Lift(LeftRight(9.0, 9.0), kVertical).empty());
}

TEST(Lift, DropsSegmentsThatAreShortOrNotFinite) {
  const DepthImage depth = LeftRight(2.0, 2.0);
  EXPECT_TRUE(Lift(depth, {{100.0, 100.0}, {111.0, 100.0}}).empty());
  EXPECT_TRUE(Lift(depth, {{100.0, 100.0}, {100.0, 100.0}}).empty());
  EXPECT_TRUE(Lift(depth, {{kNaN, 100.0}, {160.0, 100.0}}).empty());
  EXPECT_TRUE(
      Lift(depth, {{100.0, 100.0}, {std::numeric_limits<double>::infinity(), 100.0}}).empty());
}

TEST(Lift, SegmentsMayReachOutOfTheImage) {
  const DepthImage depth = LeftRight(2.0, 2.0);
  EXPECT_TRUE(Lift(depth, {{-1e12, 50.0}, {-1e9, 60.0}}).empty());
  const auto lifted = Lift(depth, {{-60.0, 100.0}, {240.0, 100.0}});
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_GE(lifted[0].segment_px.start.x(), -8.0);  // a column is 7.5 px wide
  EXPECT_NEAR(lifted[0].segment_px.end.x(), 240.0, 1e-9);
}

TEST(Lift, SourceNamesTheSegment) {
  const std::vector<Segment2> segments{{{0, 0}, {5, 0}}, kVertical, {{3, 3}, {3, 3}}, kVertical};
  const auto lifted = LiftSegments(kCamera, LeftRight(2.0, 2.0).View(), segments);
  ASSERT_EQ(lifted.size(), 2u);
  EXPECT_EQ(lifted[0].source, 1u);
  EXPECT_EQ(lifted[1].source, 3u);
}

TEST(Lift, MirroredCameraKeepsPixelsAndDepth) {
  Camera mirrored = kCamera;
  mirrored.fy = -mirrored.fy;
  const auto lifted = Lift(LeftRight(1.0, 2.0), kVertical, mirrored);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_NEAR(lifted[0].segment_in_cam.start.z(), 1.0, 1e-4);
  EXPECT_GT(lifted[0].segment_in_cam.start.y(), 0.0);  // above the centre: y is mirrored
  EXPECT_LT((mirrored.Project(lifted[0].segment_in_cam.end) - kVertical.end).norm(), 1e-9);
}

TEST(Lift, SixteenBitDepthEqualsFloat) {
  std::vector<uint16_t> raw(320 * 240, 65535);
  DepthImage metres = LeftRight(0.0, 0.0);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 170; ++x) {
      raw[y * 320 + x] = static_cast<uint16_t>(10000 + 10 * y);
      metres.at(x, y) = static_cast<float>(2.0 + 0.002 * y);
    }
  }
  const DepthView view{DepthFormat::kUint16, raw.data(), 640, 320, 240, 1.0 / 5000.0};
  const auto from_raw = LiftSegments(kCamera, view, std::vector<Segment2>{kVertical});
  const auto from_metres = Lift(metres, kVertical);
  ASSERT_EQ(from_raw.size(), 1u);
  ASSERT_EQ(from_metres.size(), 1u);
  EXPECT_LT((from_raw[0].segment_in_cam.start - from_metres[0].segment_in_cam.start).norm(), 1e-5);
  EXPECT_LT((from_raw[0].segment_in_cam.end - from_metres[0].segment_in_cam.end).norm(), 1e-5);
}

TEST(Lift, NoisyDepthIsAveraged) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const DepthNoise noise;
  const DepthImage depth =
      MakeDepth(kCamera, [&](int, int) { return 2.0 + noise.SigmaAt(2.0) * normal(random); });
  const auto lifted = Lift(depth, kVertical);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_NEAR(lifted[0].segment_in_cam.start.z(), 2.0, noise.SigmaAt(2.0) / 2.0);
  EXPECT_NEAR(lifted[0].segment_in_cam.end.z(), 2.0, noise.SigmaAt(2.0) / 2.0);
}

TEST(Lift, EqualInputsGiveEqualBytes) {
  const DepthImage depth =
      MakeDepth(kCamera, [](int x, int y) { return 2.0 + 0.002 * x + Clutter(x, y, 0.0, 0.03); });
  const auto a = Lift(depth, kVertical), b = Lift(depth, kVertical);
  ASSERT_EQ(a.size(), 1u);
  ASSERT_EQ(b.size(), 1u);
  EXPECT_EQ(a[0].segment_in_cam.start, b[0].segment_in_cam.start);
  EXPECT_EQ(a[0].segment_in_cam.end, b[0].segment_in_cam.end);
}

TEST(DepthView, NamesWhatIsInvalid) {
  const std::vector<uint16_t> raw(8, 1);
  const DepthView good{DepthFormat::kUint16, raw.data(), 8, 4, 2, 0.001};
  EXPECT_TRUE(good.Validate().has_value());

  const auto message = [&](auto change) {
    DepthView view = good;
    change(view);
    const Status status = view.Validate();
    return status.has_value() ? std::string() : status.error().message;
  };
  EXPECT_NE(message([](DepthView& v) { v.data = nullptr; }).find("no data"), std::string::npos);
  EXPECT_NE(message([](DepthView& v) { v.width_px = 0; }).find("0 x 2"), std::string::npos);
  EXPECT_NE(message([](DepthView& v) { v.row_stride_bytes = 6; }).find("6 bytes"),
            std::string::npos);
  EXPECT_NE(message([](DepthView& v) { v.row_stride_bytes = 9; }).find("aligned"),
            std::string::npos);
  EXPECT_NE(message([](DepthView& v) { v.metres_per_unit = 0.0; }).find("scale"),
            std::string::npos);
  EXPECT_NE(message([](DepthView& v) { v.metres_per_unit = kNaN; }).find("scale"),
            std::string::npos);
}

TEST(DepthView, NoDepthIsZero) {
  const uint16_t raw[3] = {0, 65535, 1500};
  const DepthView view16{DepthFormat::kUint16, raw, 6, 3, 1, 0.001};
  EXPECT_EQ(view16.MetresAt(0, 0), 0.0f);
  EXPECT_EQ(view16.MetresAt(1, 0), 0.0f);
  EXPECT_FLOAT_EQ(view16.MetresAt(2, 0), 1.5f);
  const float metres[4] = {static_cast<float>(kNaN), -2.0f, std::numeric_limits<float>::infinity(),
                           1.5f};
  const DepthView view32{DepthFormat::kFloat, metres, 16, 4, 1, 2.0};
  EXPECT_EQ(view32.MetresAt(0, 0), 0.0f);
  EXPECT_EQ(view32.MetresAt(1, 0), 0.0f);
  EXPECT_EQ(view32.MetresAt(2, 0), 0.0f);
  EXPECT_FLOAT_EQ(view32.MetresAt(3, 0), 3.0f);
}

}  // namespace
}  // namespace plumb
