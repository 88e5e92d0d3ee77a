// Candidate pairs of projected lines and segments, and the lines that a camera sees.
#include "plumb/map/line_association.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "plumb/geometry/line_projection.h"
#include "plumb/map/line_cloud.h"

namespace plumb {
namespace {

constexpr AssociationGate kGate{0.06, 4.0, 0.3, 0.005};
constexpr double kFar = std::numeric_limits<double>::max();

std::vector<AssociationCandidate> Candidates(const Segment2& line,
                                             const std::vector<Segment2>& segments) {
  std::vector<AssociationCandidate> out;
  SegmentsByAngle(segments).AppendCandidates({7, line}, kGate, &out);
  return out;
}

TEST(LineAssociation, FindsASegmentNearTheLine) {
  const auto found = Candidates({{10, 20}, {110, 20}}, {{{30, 22}, {90, 23}}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].line, 7u);
  EXPECT_EQ(found[0].segment, 0u);
  EXPECT_NEAR(found[0].distance_px, 3.0, 1e-12);
}

TEST(LineAssociation, DirectionsDoNotMatterAtAnyAngle) {
  for (int k = 0; k < 72; ++k) {
    const double angle = k * std::numbers::pi / 36.0 + 1e-9;
    const Eigen::Vector2d d(std::cos(angle), std::sin(angle)), n(-d.y(), d.x());
    const Eigen::Vector2d c(100.0, 100.0);
    // Turned by 0.03 rad, which crosses the end of the angles' range for some k.
    const double other = angle + (k % 2 == 0 ? 0.03 : -0.03);
    const Eigen::Vector2d e(std::cos(other), std::sin(other));
    const std::vector<Segment2> segments{{c - 20.0 * e + n, c + 20.0 * e + n},
                                         {c + 20.0 * e + n, c - 20.0 * e + n}};
    const auto found = Candidates({c - 40.0 * d, c + 40.0 * d}, segments);
    EXPECT_EQ(found.size(), 2u) << k;
  }
}

TEST(LineAssociation, EveryGateHolds) {
  const Segment2 line{{10, 20}, {110, 20}};
  EXPECT_TRUE(Candidates(line, {{{30, 25}, {90, 25}}}).empty());    // 5 px away
  EXPECT_TRUE(Candidates(line, {{{30, 20}, {60, 22.5}}}).empty());  // sine 0.083
  EXPECT_TRUE(Candidates(line, {{{100, 20}, {160, 20}}}).empty());  // 10 px of 60 overlap
  EXPECT_EQ(Candidates(line, {{{90, 20}, {150, 20}}}).size(), 1u);  // 20 px of 60 do
  EXPECT_TRUE(Candidates(line, {{{120, 20}, {160, 20}}}).empty());  // beside it
  EXPECT_TRUE(Candidates(line, {{{50, 20}, {50, 20}}}).empty());    // a point
  EXPECT_TRUE(Candidates({{5, 5}, {5, 5}}, {{{0, 5}, {9, 5}}}).empty());
}

TEST(LineAssociation, DistanceIsTakenInsideTheOverlapOnly) {
  // The segment leaves the line by 5 px, but only beyond the line's end.
  const auto found = Candidates({{0, 0}, {50, 0}}, {{{0, 0}, {100, 5}}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].distance_px, 2.5, 0.01);
}

TEST(LineAssociation, EqualsBruteForce) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(0.0, 60.0);
  std::vector<Segment2> segments;
  for (int k = 0; k < 300; ++k) {
    segments.push_back({{uniform(random), uniform(random)}, {uniform(random), uniform(random)}});
  }
  size_t total = 0;
  for (int k = 0; k < 50; ++k) {
    const Segment2 line{{uniform(random), uniform(random)}, {uniform(random), uniform(random)}};
    size_t expected = 0;
    for (const Segment2& segment : segments) expected += Candidates(line, {segment}).size();
    EXPECT_EQ(Candidates(line, segments).size(), expected);
    total += expected;
  }
  EXPECT_GT(total, 50u);
}

TEST(LineCloud, SeesWhatProjectionSees) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-5.0, 5.0);
  const auto point = [&] {
    return Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
  };
  LineCloud cloud;
  for (int k = 0; k < 2000; ++k) cloud.Add({point(), point()});
  for (const double fy : {300.0, -300.0}) {
    const Camera camera{320.0, fy, 150.0, 110.0, 320, 240};
    const Rigid3 cam_from_world{ExpSo3({0.3, -0.8, 0.4}), {0.5, 0.2, 1.0}};
    std::vector<ProjectedLine> projected;
    cloud.Project(camera, cam_from_world, 15.0, kFar, &projected);
    std::vector<uint32_t> expected;
    for (uint32_t i = 0; i < cloud.size(); ++i) {
      const auto segment = ProjectSegment(camera, cam_from_world, cloud[i]);
      if (segment && segment->Length() > 15.0) expected.push_back(i);
    }
    ASSERT_EQ(projected.size(), expected.size());
    for (size_t k = 0; k < expected.size(); ++k) EXPECT_EQ(projected[k].line, expected[k]);
    EXPECT_GT(expected.size(), 100u);
  }
}

TEST(LineCloud, FartherLinesAreLeftOut) {
  LineCloud cloud;
  cloud.Add({{-0.5, 0.0, 4.0}, {0.5, 0.0, 4.0}});
  cloud.Add({{-0.5, 0.0, 9.0}, {0.5, 0.0, 9.0}});
  const Camera camera{300.0, 300.0, 160.0, 120.0, 320, 240};
  std::vector<ProjectedLine> projected;
  cloud.Project(camera, Rigid3(), 8.0, 6.0, &projected);
  ASSERT_EQ(projected.size(), 1u);
  EXPECT_EQ(projected[0].line, 0u);
  cloud.Set(1, {{-0.5, 0.0, 5.0}, {0.5, 0.0, 5.0}});
  cloud.Project(camera, Rigid3(), 8.0, 6.0, &projected);
  EXPECT_EQ(projected.size(), 2u);
}

}  // namespace
}  // namespace plumb
