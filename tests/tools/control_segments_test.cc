#include "tools/metrics/control_segments.h"

#include <vector>

#include <gtest/gtest.h>

namespace plumb::tools {
namespace {

const std::vector<Segment2> kSegments{{{0, 10}, {30, 50}, 0.9}, {{600, 0}, {639, 479}, 0.2}};

TEST(MirrorSegments, FirstColumnBecomesTheLast) {
  const std::vector<Segment2> mirrored = MirrorSegments(kSegments, 640);
  EXPECT_EQ(mirrored[0].start, Eigen::Vector2d(639, 10));
  EXPECT_EQ(mirrored[1].end, Eigen::Vector2d(0, 479));
  EXPECT_EQ(mirrored[1].score, 0.2);
}

TEST(MirrorSegments, TwiceIsTheImageItself) {
  const std::vector<Segment2> twice = MirrorSegments(MirrorSegments(kSegments, 640), 640);
  for (size_t i = 0; i < kSegments.size(); ++i) {
    EXPECT_EQ(twice[i].start, kSegments[i].start);
    EXPECT_EQ(twice[i].end, kSegments[i].end);
  }
}

TEST(ScatterSegments, KeepsLengthsAndStaysInside) {
  const std::vector<Segment2> many(200, kSegments[0]);
  for (const Segment2& segment : ScatterSegments(many, 640, 480, 3)) {
    EXPECT_NEAR(segment.Length(), 50.0, 1e-9);
    EXPECT_EQ(segment.score, 0.9);
    for (const Eigen::Vector2d& end : {segment.start, segment.end}) {
      EXPECT_TRUE(end.x() >= -1e-9 && end.x() <= 639.0 + 1e-9);
      EXPECT_TRUE(end.y() >= -1e-9 && end.y() <= 479.0 + 1e-9);
    }
  }
}

TEST(ScatterSegments, SeedsDecide) {
  EXPECT_EQ(ScatterSegments(kSegments, 640, 480, 1)[0].start,
            ScatterSegments(kSegments, 640, 480, 1)[0].start);
  EXPECT_NE(ScatterSegments(kSegments, 640, 480, 1)[0].start,
            ScatterSegments(kSegments, 640, 480, 2)[0].start);
}

TEST(ScatterSegments, LongerThanTheImageSitsInItsMiddle) {
  const std::vector<Segment2> longer{{{0, 0}, {0, 5000}}};
  const Segment2 scattered = ScatterSegments(longer, 640, 480, 1)[0];
  EXPECT_NEAR(scattered.Length(), 5000.0, 1e-6);
  EXPECT_TRUE(scattered.Midpoint().allFinite());
}

}  // namespace
}  // namespace plumb::tools
