#include "plumb/matching/soft_association.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "plumb/matching/overlap.h"
#include "support/allocation_counter.h"
#include "support/line_scene.h"

namespace plumb {
namespace {

using testing::AsProjectedLines;
using ::testing::IsEmpty;
using testing::LineScene;
using testing::MakeLineScene;
using ::testing::SizeIs;

/// Geometry of one line and one segment in double precision, straight from the definition.
struct PairGeometry {
  double sine, overlap, begin, end, square;
};

PairGeometry Measure(const Segment2& line, const Segment2& segment) {
  const Eigen::Vector2d d = line.Delta() / line.Length();
  const Eigen::Vector2d s = segment.Delta() / segment.Length();
  const double a = (segment.start - line.start).dot(d), b = (segment.end - line.start).dot(d);
  const double first = std::max(std::min(a, b), 0.0);
  const double last = std::min(std::max(a, b), line.Length());
  PairGeometry pair;
  pair.sine = std::abs(d.x() * s.y() - d.y() * s.x());
  pair.overlap = last - first;
  pair.begin = (first - a) / (b - a);
  pair.end = (last - a) / (b - a);
  pair.square = 0.0;
  for (const double u : {pair.begin, pair.end}) {
    const Eigen::Vector2d x = segment.start + u * segment.Delta() - line.start;
    pair.square += 0.5 * std::pow(d.x() * x.y() - d.y() * x.x(), 2);
  }
  return pair;
}

using PairKey = std::pair<uint32_t, uint32_t>;  // line, segment

std::map<PairKey, double> AssociatePlainly(const std::vector<Segment2>& lines,
                                           const std::vector<Segment2>& segments,
                                           const AssociationGates& gates) {
  std::map<PairKey, double> e;
  std::vector<double> line_sum(lines.size()), segment_sum(segments.size());
  for (uint32_t i = 0; i < lines.size(); ++i) {
    for (uint32_t j = 0; j < segments.size(); ++j) {
      const PairGeometry pair = Measure(lines[i], segments[j]);
      const double shorter = std::min(lines[i].Length(), segments[j].Length());
      if (!(std::sqrt(pair.square) < 3.0 * gates.sigma_px) ||
          !(pair.sine < 3.0 * gates.sigma_sine) || !(pair.overlap > gates.min_overlap_px) ||
          !(pair.overlap > gates.min_overlap_share * shorter)) {
        continue;
      }
      const double value =
          std::exp(-pair.square / (2.0 * gates.sigma_px * gates.sigma_px) -
                   pair.sine * pair.sine / (2.0 * gates.sigma_sine * gates.sigma_sine));
      e[{i, j}] = value;
      line_sum[i] += value;
      segment_sum[j] += value;
    }
  }
  for (auto& [key, value] : e) {
    value *= std::min(1.0 / (0.1 + segment_sum[key.second]), 1.5 / (0.1 + line_sum[key.first]));
  }
  return e;
}

std::vector<LinePair> Associate(const ProjectedLines& lines, const std::vector<Segment2>& segments,
                                const AssociationGates& gates = {}) {
  SegmentTable table;
  table.Assign(segments);
  std::vector<LinePair> pairs;
  SoftAssociator().Associate(lines, table, gates, &pairs);
  return pairs;
}

TEST(MeasureOverlaps, AgreesWithTheDefinition) {
  const LineScene scene = MakeLineScene(40, /*seed=*/1, /*noise_px=*/3.0);
  ProjectedLines lines;
  ProjectCandidates(scene.camera, scene.cam_from_world, scene.lines, 10.0, &lines);
  SegmentTable table;
  table.Assign(scene.segments);
  OverlapColumns columns;
  columns.Reserve(table.size());
  size_t num_overlapping = 0;
  for (size_t row = 0; row < lines.size(); ++row) {
    const auto image = ProjectSegment(scene.camera, scene.cam_from_world,
                                      scene.lines[lines.line[row]].segment_in_world);
    const SegmentTable::Range range = {3, static_cast<uint32_t>(table.size())};
    MeasureOverlaps(lines, row, table, range, &columns);
    for (uint32_t k = 0; k < range.end - range.begin; ++k) {
      const PairGeometry pair = Measure(*image, scene.segments[table.source[range.begin + k]]);
      EXPECT_NEAR(columns.sine[k], pair.sine, 1e-5);
      if (pair.sine > 0.9) continue;  // hardly any extent along the line
      EXPECT_NEAR(columns.overlap[k], pair.overlap, 1e-2);
      if (!(pair.overlap > 1.0)) continue;
      ++num_overlapping;
      EXPECT_NEAR(columns.begin[k], pair.begin, 1e-3);
      EXPECT_NEAR(columns.end[k], pair.end, 1e-3);
      EXPECT_NEAR(std::sqrt(columns.square[k]), std::sqrt(pair.square), 2e-2);
    }
  }
  EXPECT_GT(num_overlapping, 1000u);
}

TEST(SoftAssociator, AgreesWithAPlainDoubleLoop) {
  for (const unsigned seed : {2u, 3u, 4u}) {
    const LineScene scene = MakeLineScene(120, seed, /*noise_px=*/2.0);
    ProjectedLines lines;
    ProjectCandidates(scene.camera, scene.cam_from_world, scene.lines, 10.0, &lines);
    std::vector<Segment2> images;
    for (const uint32_t line : lines.line) {
      images.push_back(
          *ProjectSegment(scene.camera, scene.cam_from_world, scene.lines[line].segment_in_world));
    }
    for (const AssociationGates& gates : {AssociationGates{}, AssociationGates{8.0, 0.12, 8.0, 0.3},
                                          AssociationGates{20.0, 0.4, 1.0, 0.0}}) {
      std::map<PairKey, double> expected = AssociatePlainly(images, scene.segments, gates);
      for (const LinePair& pair : Associate(lines, scene.segments, gates)) {
        const auto row = std::find(lines.line.begin(), lines.line.end(), pair.line);
        const PairKey key(static_cast<uint32_t>(row - lines.line.begin()), pair.segment);
        const auto found = expected.find(key);
        ASSERT_NE(found, expected.end()) << key.first << " " << key.second;
        EXPECT_NEAR(pair.weight, found->second, 1e-3);
        expected.erase(found);
      }
      EXPECT_THAT(expected, IsEmpty()) << "pairs that were not found";
    }
  }
}

TEST(SoftAssociator, GivesAPerfectPairAlmostAllTheWeight) {
  const Segment2 image = {{100, 100}, {200, 150}};
  const auto pairs = Associate(AsProjectedLines({image}, {1}), {image});
  ASSERT_THAT(pairs, SizeIs(1));
  EXPECT_NEAR(pairs[0].weight, 1.0 / 1.1, 1e-4) << "0.1 is left for neither";
  EXPECT_NEAR(pairs[0].overlap_px, image.Length(), 1e-3);
  EXPECT_NEAR(pairs[0].square_px2, 0.0, 1e-6);
}

TEST(SoftAssociator, SharesASegmentBetweenItsLines) {
  const Segment2 image = {{100, 100}, {200, 100}};
  const auto pairs = Associate(AsProjectedLines({image, image}, {1, 1}), {image});
  ASSERT_THAT(pairs, SizeIs(2));
  EXPECT_NEAR(pairs[0].weight, 1.0 / 2.1, 1e-4);
  EXPECT_NEAR(pairs[1].weight, 1.0 / 2.1, 1e-4);
}

TEST(SoftAssociator, LetsALineOwnSeveralFragments) {
  const Segment2 image = {{100, 100}, {300, 100}};
  const auto pairs = Associate(AsProjectedLines({image}, {1}),
                               {{{100, 100}, {190, 100}}, {{210, 100}, {300, 100}}});
  ASSERT_THAT(pairs, SizeIs(2));
  for (const LinePair& pair : pairs) EXPECT_NEAR(pair.weight, 1.5 / 2.1, 1e-4);
}

TEST(SoftAssociator, HasNoPairBeyondThreeSigma) {
  const ProjectedLines lines = AsProjectedLines({{{100, 100}, {200, 100}}}, {1});
  EXPECT_THAT(Associate(lines, {{{100, 105.9}, {200, 105.9}}}), SizeIs(1));
  EXPECT_THAT(Associate(lines, {{{100, 106.1}, {200, 106.1}}}), IsEmpty());
  // The mean square of the two ends counts: 8 px at one end alone are within 6 px.
  EXPECT_THAT(Associate(lines, {{{100, 100}, {200, 108}}}), SizeIs(1));
}

TEST(SoftAssociator, HasNoPairAcrossThreeSigmaOfTheSine) {
  const ProjectedLines lines = AsProjectedLines({{{100, 100}, {200, 100}}}, {1});
  const auto turned = [](double sine) {
    const Eigen::Vector2d half(10.0 * std::sqrt(1.0 - sine * sine), 10.0 * sine);
    const Eigen::Vector2d center(150.0, 100.0);
    return std::vector<Segment2>{{center - half, center + half}};
  };
  EXPECT_THAT(Associate(lines, turned(0.149)), SizeIs(1));
  EXPECT_THAT(Associate(lines, turned(0.151)), IsEmpty());
}

TEST(SoftAssociator, NeedsEnoughOverlap) {
  const ProjectedLines lines = AsProjectedLines({{{100, 100}, {200, 100}}}, {1});
  EXPECT_THAT(Associate(lines, {{{191, 100}, {211, 100}}}), SizeIs(1)) << "9 px of 20";
  EXPECT_THAT(Associate(lines, {{{193, 100}, {213, 100}}}), IsEmpty()) << "7 px";
  EXPECT_THAT(Associate(lines, {{{171, 100}, {271, 100}}}), IsEmpty()) << "29 % of the shorter";
  EXPECT_THAT(Associate(lines, {{{169, 100}, {269, 100}}}), SizeIs(1)) << "31 % of the shorter";
  EXPECT_THAT(Associate(lines, {{{220, 100}, {300, 100}}}), IsEmpty()) << "beside it";
}

TEST(SoftAssociator, DoesNotCareForTheDirectionOfASegment) {
  const ProjectedLines lines = AsProjectedLines({{{100, 100}, {200, 101}}}, {1});
  const auto forward = Associate(lines, {{{110, 101}, {180, 99}}});
  const auto backward = Associate(lines, {{{180, 99}, {110, 101}}});
  ASSERT_THAT(forward, SizeIs(1));
  ASSERT_THAT(backward, SizeIs(1));
  EXPECT_NEAR(forward[0].weight, backward[0].weight, 1e-5);
  EXPECT_NEAR(forward[0].begin, 1.0f - backward[0].begin, 1e-5);
}

TEST(SoftAssociator, ReportsTheOverlapsEndsOnTheSegment) {
  const ProjectedLines lines = AsProjectedLines({{{100, 100}, {200, 100}}}, {1});
  const auto pairs = Associate(lines, {{{50, 100}, {150, 100}}});
  ASSERT_THAT(pairs, SizeIs(1));
  EXPECT_NEAR(pairs[0].begin, 0.5, 1e-5);
  EXPECT_NEAR(pairs[0].end, 1.0, 1e-5);
}

TEST(SoftAssociator, NamesLinesByTheirIndexAmongTheCandidates) {
  std::vector<CandidateLine> lines(3);
  lines[0].segment_in_world = {{0, 0, -1}, {1, 0, -1}};  // behind the camera
  lines[1].segment_in_world = {{0, 50, 1}, {50, 50, 1}};
  lines[2].segment_in_world = {{0, 90, 1}, {50, 90, 1}};
  ProjectedLines projected;
  ProjectCandidates({1.0, 1.0, 0.0, 0.0, 640, 480}, {}, lines, 0.0, &projected);
  const auto pairs = Associate(projected, {{{0, 90}, {50, 90}}, {{0, 50}, {50, 50}}});
  ASSERT_THAT(pairs, SizeIs(2));
  EXPECT_EQ(pairs[0].line, 1u);
  EXPECT_EQ(pairs[0].segment, 1u);
  EXPECT_EQ(pairs[1].line, 2u);
  EXPECT_EQ(pairs[1].segment, 0u);
}

TEST(SoftAssociator, HasNoPairsWithoutLinesOrSegments) {
  const Segment2 image = {{100, 100}, {200, 100}};
  EXPECT_THAT(Associate(AsProjectedLines({image}, {1}), {}), IsEmpty());
  EXPECT_THAT(Associate(ProjectedLines{}, {image}), IsEmpty());
}

TEST(SoftAssociator, DoesNotAllocateOnceWarm) {
  const LineScene scene = MakeLineScene(100, /*seed=*/5);
  ProjectedLines lines;
  ProjectCandidates(scene.camera, scene.cam_from_world, scene.lines, 10.0, &lines);
  SegmentTable table;
  table.Assign(scene.segments);
  SoftAssociator associator;
  std::vector<LinePair> pairs;
  associator.Associate(lines, table, {8.0, 0.12, 8.0, 0.3}, &pairs);
  const size_t before = testing::num_allocations;
  ProjectCandidates(scene.camera, scene.cam_from_world, scene.lines, 10.0, &lines);
  associator.Associate(lines, table, {}, &pairs);
  EXPECT_EQ(testing::num_allocations, before);
}

}  // namespace
}  // namespace plumb
