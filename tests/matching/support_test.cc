#include "plumb/matching/support.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/line_scene.h"

namespace plumb {
namespace {

using testing::AsProjectedLines;
using testing::LineScene;
using testing::MakeLineScene;

PoseSupport Measure(const ProjectedLines& lines, const std::vector<Segment2>& segments) {
  SegmentTable table;
  table.Assign(segments);
  return SupportMeter().Measure(lines, table);
}

/// Straight from the definition, in double precision.
PoseSupport MeasurePlainly(const std::vector<Segment2>& lines, const std::vector<double>& weights,
                           const std::vector<Segment2>& segments) {
  std::vector<double> of_segment(segments.size());
  double explained = 0.0, visible = 0.0;
  for (size_t i = 0; i < lines.size(); ++i) {
    double of_line = 0.0;
    const Eigen::Vector2d d = lines[i].Delta() / lines[i].Length();
    const auto across = [&](const Eigen::Vector2d& x) {
      return d.x() * (x - lines[i].start).y() - d.y() * (x - lines[i].start).x();
    };
    for (size_t j = 0; j < segments.size(); ++j) {
      const Segment2& s = segments[j];
      const double a = (s.start - lines[i].start).dot(d), b = (s.end - lines[i].start).dot(d);
      const double first = std::max(std::min(a, b), 0.0);
      const double last = std::min(std::max(a, b), lines[i].Length());
      const Eigen::Vector2d v = s.Delta() / s.Length();
      if (!(last - first > 8.0) || !(std::abs(d.x() * v.y() - d.y() * v.x()) < 0.12)) continue;
      const double h0 = across(s.start + (first - a) / (b - a) * s.Delta());
      const double h1 = across(s.start + (last - a) / (b - a) * s.Delta());
      const double value = (last - first) / std::pow(1.0 + 0.5 * (h0 * h0 + h1 * h1) / 4.0, 2);
      of_line = std::max(of_line, value);
      of_segment[j] = std::max(of_segment[j], value * weights[i]);
    }
    explained += weights[i] * std::min(of_line, 150.0);
    visible += weights[i] * std::min(lines[i].Length(), 150.0);
  }
  PoseSupport support;
  for (const double value : of_segment) support.detected_px += std::min(value, 150.0);
  support.map_share = explained / std::max(visible, 1.0);
  return support;
}

TEST(SupportMeter, AgreesWithTheDefinition) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    const LineScene scene = MakeLineScene(120, seed, /*noise_px=*/1.5);
    ProjectedLines lines;
    ProjectCandidates(scene.camera, scene.cam_from_world, scene.lines, 10.0, &lines);
    std::vector<Segment2> images;
    std::vector<double> weights;
    for (const uint32_t line : lines.line) {
      images.push_back(
          *ProjectSegment(scene.camera, scene.cam_from_world, scene.lines[line].segment_in_world));
      weights.push_back(scene.lines[line].weight);
    }
    const PoseSupport expected = MeasurePlainly(images, weights, scene.segments);
    const PoseSupport support = Measure(lines, scene.segments);
    EXPECT_GT(expected.map_share, 0.2);
    EXPECT_NEAR(support.detected_px, expected.detected_px, 1e-3 * expected.detected_px);
    EXPECT_NEAR(support.map_share, expected.map_share, 1e-3);
  }
}

TEST(SupportMeter, ExplainsEverythingAtThePerfectPose) {
  const std::vector<Segment2> images = {{{100, 100}, {200, 100}}, {{50, 50}, {50, 130}}};
  const PoseSupport support = Measure(AsProjectedLines(images, {1, 1}), images);
  EXPECT_NEAR(support.map_share, 1.0, 1e-5);
  EXPECT_NEAR(support.detected_px, 180.0, 1e-2);
  EXPECT_NEAR(support.Value(), 180.0, 1e-2);
}

TEST(SupportMeter, FallsWithTheSquareOfTheDistance) {
  const ProjectedLines lines = AsProjectedLines({{{100, 100}, {200, 100}}}, {1});
  EXPECT_NEAR(Measure(lines, {{{100, 102}, {200, 102}}}).map_share, 0.25, 1e-5);
  EXPECT_NEAR(Measure(lines, {{{100, 104}, {200, 104}}}).map_share, 1.0 / 25.0, 1e-5);
}

TEST(SupportMeter, CountsAtMost150PixelsOfALineOrSegment) {
  const std::vector<Segment2> images = {{{0, 100}, {600, 100}}};
  const PoseSupport support = Measure(AsProjectedLines(images, {1}), images);
  EXPECT_NEAR(support.detected_px, 150.0, 1e-3);
  EXPECT_NEAR(support.map_share, 1.0, 1e-5);
  // A quarter of it is enough for a full share of the map.
  EXPECT_NEAR(Measure(AsProjectedLines(images, {1}), {{{0, 100}, {150, 100}}}).map_share, 1.0,
              1e-5);
}

TEST(SupportMeter, WeighsLinesByTheirStability) {
  const std::vector<Segment2> images = {{{100, 100}, {200, 100}}, {{100, 300}, {200, 300}}};
  const ProjectedLines lines = AsProjectedLines(images, {0.9f, 0.1f});
  const PoseSupport stable = Measure(lines, {images[0]}), unstable = Measure(lines, {images[1]});
  EXPECT_NEAR(stable.map_share, 0.9, 1e-5);
  EXPECT_NEAR(unstable.map_share, 0.1, 1e-5);
  EXPECT_NEAR(stable.detected_px, 90.0, 1e-3);
  EXPECT_NEAR(unstable.detected_px, 10.0, 1e-3);
}

TEST(SupportMeter, CountsASegmentOnceHoweverManyLinesExplainIt) {
  const Segment2 image = {{100, 100}, {200, 100}};
  EXPECT_NEAR(Measure(AsProjectedLines({image, image, image}, {1, 1, 1}), {image}).detected_px,
              100.0, 1e-3);
}

TEST(SupportMeter, IgnoresSlantedAndShortOverlaps) {
  const ProjectedLines lines = AsProjectedLines({{{100, 100}, {200, 100}}}, {1});
  EXPECT_EQ(Measure(lines, {{{130, 98}, {170, 103}}}).Value(), 0.0) << "sine 0.124";
  EXPECT_GT(Measure(lines, {{{130, 98}, {170, 102}}}).Value(), 0.0) << "sine 0.1";
  EXPECT_EQ(Measure(lines, {{{193, 100}, {260, 100}}}).Value(), 0.0) << "7 px";
}

TEST(SupportMeter, IsZeroWithoutLinesOrSegments) {
  const Segment2 image = {{100, 100}, {200, 100}};
  EXPECT_EQ(Measure(ProjectedLines{}, {image}).Value(), 0.0);
  EXPECT_EQ(Measure(AsProjectedLines({image}, {1}), {}).Value(), 0.0);
}

TEST(SupportMeter, StartsAfreshEveryTime) {
  const std::vector<Segment2> images = {{{100, 100}, {200, 100}}, {{50, 50}, {50, 130}}};
  SegmentTable table;
  SupportMeter meter;
  table.Assign(images);
  const PoseSupport first = meter.Measure(AsProjectedLines(images, {1, 1}), table);
  table.Assign({images.data(), 1});
  meter.Measure(AsProjectedLines({images[1]}, {1}), table);
  table.Assign(images);
  const PoseSupport again = meter.Measure(AsProjectedLines(images, {1, 1}), table);
  EXPECT_EQ(first.detected_px, again.detected_px);
  EXPECT_EQ(first.map_share, again.map_share);
}

}  // namespace
}  // namespace plumb
