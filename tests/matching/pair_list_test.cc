#include "plumb/matching/pair_list.h"

#include <map>
#include <utility>

#include <gtest/gtest.h>

#include "plumb/matching/candidate_table.h"
#include "support/line_scene.h"

namespace plumb {
namespace {

using testing::LineScene;
using testing::MakeLineScene;

using Weights = std::map<std::pair<int32_t, int32_t>, float>;

Weights WeightsOf(const PairList& list) {
  Weights out;
  const PairList::Pairs& pairs = list.pairs();
  for (size_t p = 0; p < pairs.size(); ++p) {
    out[{pairs.line[p], pairs.segment[p]}] = pairs.weight[p];
  }
  return out;
}

struct Fixture {
  explicit Fixture(unsigned seed, int num_lines = 150) : scene(MakeLineScene(num_lines, seed)) {
    table.Assign(scene.segments);
    lines.Assign(scene.lines, scene.cam_from_world);
  }
  ProjectedLines ProjectedFrom(const Vector6d& moved) const {
    ProjectedLines out;
    ProjectTable(scene.camera, Perturb(scene.cam_from_world, moved), lines, 10.0, &out);
    return out;
  }
  LineScene scene;
  SegmentTable table;
  CandidateTable lines;
};

TEST(PairList, WeighedElsewhereIsTheSameAsListedThere) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Fixture fixture(seed);
    PairList once, anew;
    once.Build(fixture.ProjectedFrom(Vector6d::Zero()), fixture.table, {8.0, 0.12}, 3.0);
    // Each step moves the image by a few pixels while the gates shrink.
    Vector6d moved = Vector6d::Zero();
    for (const AssociationGates& gates :
         {AssociationGates{6.0, 0.10}, AssociationGates{3.0, 0.06}, AssociationGates{1.0, 0.04}}) {
      moved += (Vector6d() << 0.002, -0.001, 0.002, 0.003, -0.002, 0.001).finished();
      const ProjectedLines projected = fixture.ProjectedFrom(moved);
      once.Weigh(projected, gates);
      anew.Build(projected, fixture.table, gates, 0.0);
      anew.Weigh(projected, gates);
      EXPECT_EQ(WeightsOf(once), WeightsOf(anew)) << "sigma " << gates.sigma_px;
      EXPECT_GT(once.pairs().size(), 20u);
    }
  }
}

TEST(PairList, TheOverlapsEndsLieOnTheSegment) {
  const Fixture fixture(7);
  PairList list;
  const ProjectedLines projected = fixture.ProjectedFrom(Vector6d::Zero());
  list.Build(projected, fixture.table, {}, 0.0);
  list.Weigh(projected, {});
  const PairList::Pairs& pairs = list.pairs();
  ASSERT_GT(pairs.size(), 20u);
  for (size_t p = 0; p < pairs.size(); ++p) {
    const auto row = static_cast<size_t>(pairs.segment[p]);
    const float dx = fixture.table.x1[row] - fixture.table.x0[row];
    EXPECT_NEAR(pairs.x0[p], fixture.table.x0[row] + pairs.begin[p] * dx, 1e-3);
    EXPECT_NEAR(pairs.x1[p], fixture.table.x0[row] + pairs.end[p] * dx, 1e-3);
    EXPECT_GE(std::min(pairs.begin[p], pairs.end[p]), -1e-5f);
    EXPECT_LE(std::max(pairs.begin[p], pairs.end[p]), 1.0f + 1e-5f);
  }
}

TEST(PairList, IsBounded) {
  // Every line is near every segment.
  std::vector<Segment2> images, segments;
  for (int i = 0; i < 120; ++i) images.push_back({{100, 200 + 0.01 * i}, {500, 200}});
  for (int i = 0; i < 120; ++i) segments.push_back({{150, 200 + 0.01 * i}, {450, 200}});
  const ProjectedLines lines =
      testing::AsProjectedLines(images, std::vector<float>(images.size(), 1.0f));
  SegmentTable table;
  table.Assign(segments);
  PairList list;
  list.Build(lines, table, {}, 0.0);
  EXPECT_EQ(list.num_listed(), PairList::kMaxPairs);
  list.Weigh(lines, {});
  EXPECT_EQ(list.pairs().size(), PairList::kMaxPairs);
  EXPECT_EQ(list.pairs().line.front(), 0);
}

TEST(PairList, IsEmptyWithoutSegmentsOrLines) {
  SegmentTable none;
  none.Assign({});
  const Fixture fixture(2, 20);
  const ProjectedLines projected = fixture.ProjectedFrom(Vector6d::Zero());
  PairList list;
  list.Build(projected, none, {}, 3.0);
  list.Weigh(projected, {});
  EXPECT_EQ(list.pairs().size(), 0u);
  list.Build({}, fixture.table, {}, 3.0);
  list.Weigh({}, {});
  EXPECT_EQ(list.pairs().size(), 0u);
}

}  // namespace
}  // namespace plumb
