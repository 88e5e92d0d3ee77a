#include "plumb/matching/epipolar_matcher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "plumb/geometry/line_projection.h"

namespace plumb {

bool operator==(const LineAssignment& a, const LineAssignment& b) {
  return a.segment == b.segment && a.line == b.line;
}

namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr Camera kCamera{500.0, 500.0, 320.0, 240.0, 640, 480};

Rigid3 PoseAt(const Eigen::Vector3d& center, const Eigen::Vector3d& rotation = {0, 0, 0}) {
  const Eigen::Quaterniond q = ExpSo3(rotation);
  return {q, -(q * center)};
}

std::vector<Segment3> RandomLines(int count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> xy(-1.0, 1.0), z(2.0, 4.0);
  std::vector<Segment3> lines;
  for (int i = 0; i < count; ++i) {
    lines.push_back({{xy(rng), xy(rng), z(rng)}, {xy(rng), xy(rng), z(rng)}});
  }
  return lines;
}

Segment2 ImageOf(const Rigid3& pose, const Segment3& line) {
  return {kCamera.Project(pose * line.start), kCamera.Project(pose * line.end)};
}

/// The segment on z = 1 m with this image for the camera at the origin.
Segment3 Imaged(const Eigen::Vector2d& start_px, const Eigen::Vector2d& end_px) {
  return {kCamera.Normalize(start_px).homogeneous(), kCamera.Normalize(end_px).homogeneous()};
}

/// Two views of the same random lines; the database's line of segment k is 100 + k.
class TwoViewsTest : public ::testing::Test {
 protected:
  TwoViewsTest() {
    for (uint32_t k = 0; k < lines_.size(); ++k) {
      segments_.push_back(ImageOf(query_, lines_[k]));
      database_segments_.push_back(ImageOf(database_, lines_[k]));
      names_.push_back(100 + k);
    }
  }
  std::vector<MatchCandidate> Candidates(const Rigid3& prior, double min_overlap = 0.25) const {
    std::vector<MatchCandidate> candidates;
    AppendEpipolarCandidates(kCamera, prior, segments_,
                             {kCamera, database_, database_segments_, names_}, min_overlap,
                             &candidates);
    return candidates;
  }

  const std::vector<Segment3> lines_ = RandomLines(40, /*seed=*/1);
  const Rigid3 query_ = PoseAt({0.3, 0.1, -0.2}, {0.05, -0.1, 0.02}), database_ = PoseAt({0, 0, 0});
  std::vector<Segment2> segments_, database_segments_;
  std::vector<uint32_t> names_;
};

TEST_F(TwoViewsTest, HaveTheTrueMatchesAmongTheCandidates) {
  const auto candidates = Candidates(query_);
  size_t num_found = 0;
  for (uint32_t k = 0; k < lines_.size(); ++k) {
    num_found += std::count(candidates.begin(), candidates.end(), MatchCandidate{k, 100 + k}) == 1;
  }
  EXPECT_GE(num_found, 37u) << "All but lines along epipolar lines.";
  EXPECT_LT(candidates.size(), lines_.size() * lines_.size() / 2);
}

TEST_F(TwoViewsTest, KeepTheTrueMatchesUnderARoughPrior) {
  const auto candidates = Candidates(PoseAt({0.35, 0.12, -0.15}, {0.06, -0.09, 0.03}));
  size_t num_found = 0;
  for (uint32_t k = 0; k < lines_.size(); ++k) {
    num_found += std::count(candidates.begin(), candidates.end(), MatchCandidate{k, 100 + k}) == 1;
  }
  EXPECT_GE(num_found, 30u);
}

TEST_F(TwoViewsTest, HaveFewerCandidatesWhenMoreOverlapIsAskedFor) {
  const size_t few = Candidates(query_, 0.9).size(), many = Candidates(query_, 0.1).size();
  EXPECT_GT(few, 30u);
  EXPECT_LT(few, many / 2);
}

TEST_F(TwoViewsTest, AppendToWhatIsThere) {
  std::vector<MatchCandidate> candidates = {{7, 7}};
  AppendEpipolarCandidates(kCamera, query_, segments_,
                           {kCamera, database_, database_segments_, names_}, 0.25, &candidates);
  EXPECT_EQ(candidates.front(), (MatchCandidate{7, 7}));
  EXPECT_EQ(candidates.size(), 1 + Candidates(query_).size());
}

TEST_F(TwoViewsTest, HaveNoCandidatesWhenOneIsTheOtherTurned) {
  EXPECT_THAT(Candidates(PoseAt({0, 0, 0}, {0.0, 0.1, 0.0})), IsEmpty());
}

TEST(AppendEpipolarCandidates, LeavesOutSegmentsThatTheEpipoleTouches) {
  // The query camera is behind the database camera: both epipoles are the principal point.
  const Rigid3 database = PoseAt({0, 0, 0}), query = PoseAt({0, 0, -1.0});
  const std::vector<Segment2> through = {{{320.0, 200.0}, {320.0, 280.0}}};
  const std::vector<Segment2> beside = {{{300.0, 200.0}, {300.0, 280.0}}};
  const std::vector<uint32_t> names = {0};
  const auto count = [&](const std::vector<Segment2>& a, const std::vector<Segment2>& b) {
    std::vector<MatchCandidate> candidates;
    AppendEpipolarCandidates(kCamera, query, a, {kCamera, database, b, names}, 0.0, &candidates);
    return candidates.size();
  };
  EXPECT_EQ(count(beside, beside), 1u);
  EXPECT_EQ(count(through, beside), 0u);
  EXPECT_EQ(count(beside, through), 0u);
}

TEST(AppendEpipolarCandidates, SurvivesSegmentsWithoutLength) {
  const std::vector<Segment2> points = {{{100.0, 100.0}, {100.0, 100.0}}};
  const std::vector<Segment2> segments = {{{100.0, 50.0}, {100.0, 150.0}}};
  const std::vector<uint32_t> names = {0};
  std::vector<MatchCandidate> candidates;
  const Rigid3 database = PoseAt({0, 0, 0}), query = PoseAt({0.5, 0, 0});
  AppendEpipolarCandidates(kCamera, query, points, {kCamera, database, segments, names}, 0.0,
                           &candidates);
  AppendEpipolarCandidates(kCamera, query, segments, {kCamera, database, points, names}, 0.0,
                           &candidates);
  EXPECT_THAT(candidates, IsEmpty());
}

std::vector<LineAssignment> Assign(const std::vector<Segment2>& segments,
                                   const std::vector<Segment3>& lines,
                                   const std::vector<MatchCandidate>& candidates,
                                   const ReprojectionGates& gates = {}) {
  std::vector<LineAssignment> assignments(3);  // must be cleared
  AssignOneToOne(kCamera, {}, segments, lines, candidates, gates, &assignments);
  return assignments;
}

std::vector<MatchCandidate> AllPairs(uint32_t segments, uint32_t lines) {
  std::vector<MatchCandidate> pairs;
  for (uint32_t i = 0; i < segments; ++i) {
    for (uint32_t k = 0; k < lines; ++k) pairs.push_back({i, k});
  }
  return pairs;
}

TEST(AssignOneToOne, GivesEverySegmentItsOwnLine) {
  const auto lines = RandomLines(30, /*seed=*/2);
  std::vector<Segment2> segments;
  for (const Segment3& line : lines) segments.push_back(ImageOf({}, line));
  const auto assignments = Assign(segments, lines, AllPairs(30, 30));
  ASSERT_THAT(assignments, SizeIs(30));
  for (const LineAssignment& assignment : assignments) {
    EXPECT_EQ(assignment.segment, assignment.line);
    EXPECT_NEAR(assignment.projected_length_px, segments[assignment.segment].Length(), 1e-9);
  }
}

TEST(AssignOneToOne, GivesALineToTheNearerSegmentAndTheOtherNothing) {
  const std::vector<Segment3> lines = {Imaged({100, 100}, {200, 100})};
  const std::vector<Segment2> segments = {{{100, 103}, {200, 103}}, {{100, 101}, {200, 101}}};
  EXPECT_THAT(Assign(segments, lines, AllPairs(2, 1)), ElementsAre(LineAssignment{1, 0}));
}

TEST(AssignOneToOne, LeavesTheSecondBestToALoser) {
  // Both segments prefer line 0; the nearer gets it and the other takes line 1.
  const std::vector<Segment3> lines = {Imaged({100, 100}, {200, 100}),
                                       Imaged({100, 108}, {200, 108})};
  const std::vector<Segment2> segments = {{{100, 103}, {200, 103}}, {{100, 101}, {200, 101}}};
  EXPECT_THAT(Assign(segments, lines, AllPairs(2, 2)),
              ElementsAre(LineAssignment{1, 0}, LineAssignment{0, 1}));
}

TEST(AssignOneToOne, CostsTheAngleByTheProjectedLength) {
  // 4 px away and parallel is better than on the spot and turned by 0.1 over 100 px.
  const std::vector<Segment3> lines = {Imaged({100, 100}, {200, 100})};
  const std::vector<Segment2> segments = {{{100, 95}, {200, 105}}, {{100, 104}, {200, 104}}};
  EXPECT_THAT(Assign(segments, lines, AllPairs(2, 1)), ElementsAre(LineAssignment{1, 0}));
}

TEST(AssignOneToOne, BreaksTiesBySegmentThenLine) {
  const std::vector<Segment3> lines = {Imaged({100, 100}, {200, 100}),
                                       Imaged({100, 100}, {200, 100})};
  const std::vector<Segment2> segments = {{{100, 102}, {200, 102}}, {{100, 102}, {200, 102}}};
  EXPECT_THAT(Assign(segments, lines, AllPairs(2, 2)),
              ElementsAre(LineAssignment{0, 0}, LineAssignment{1, 1}));
}

TEST(AssignOneToOne, KeepsToTheGates) {
  const std::vector<Segment3> lines = {Imaged({100, 100}, {200, 100})};
  EXPECT_THAT(Assign({{{100, 109.9}, {200, 109.9}}}, lines, AllPairs(1, 1)), SizeIs(1));
  EXPECT_THAT(Assign({{{100, 110.1}, {200, 110.1}}}, lines, AllPairs(1, 1)), IsEmpty());
  EXPECT_THAT(Assign({{{130, 93}, {170, 107}}}, lines, AllPairs(1, 1)), SizeIs(1)) << "sine .33";
  EXPECT_THAT(Assign({{{130, 89}, {170, 111}}}, lines, AllPairs(1, 1)), IsEmpty()) << "sine .48";
  EXPECT_THAT(Assign({{{100, 101}, {200, 101}}}, lines, AllPairs(1, 1), {0.5, 0.4}), IsEmpty());
}

TEST(AssignOneToOne, LeavesOutLinesThatReachBehindTheNearPlane) {
  const std::vector<Segment3> lines = {{{0.0, 0.0, 1.0}, {0.0, 0.1, 0.05}},
                                       {{0.0, 0.0, 1.0}, {0.0, 0.1, -1.0}}};
  std::vector<Segment2> segments;
  for (const Segment3& line : lines) segments.push_back(ImageOf({}, line));
  EXPECT_THAT(Assign(segments, lines, AllPairs(2, 2), {1e6, 1.1}), IsEmpty());
}

TEST(AssignOneToOne, LeavesOutWhatHasNoLength) {
  const std::vector<Segment3> lines = {{{0.1, 0.1, 1.0}, {0.2, 0.2, 2.0}},  // along a ray
                                       Imaged({100, 100}, {200, 100})};
  const std::vector<Segment2> segments = {{{370, 290}, {380, 300}}, {{150, 100}, {150, 100}}};
  EXPECT_THAT(Assign(segments, lines, AllPairs(2, 2), {1e6, 1.1}),
              ElementsAre(LineAssignment{0, 1}));
}

TEST(AssignOneToOne, AssignsNothingWithoutCandidates) {
  EXPECT_THAT(Assign({{{0, 0}, {9, 9}}}, {Imaged({0, 0}, {9, 9})}, {}), IsEmpty());
}

}  // namespace
}  // namespace plumb
