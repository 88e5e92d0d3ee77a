#include "plumb/search/field_score.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "plumb/geometry/line_projection.h"
#include "plumb/search/field_alignment.h"
#include "support/synthetic_room.h"

namespace plumb {
namespace {

using testing::LookAlong;

constexpr double kDegree = std::numbers::pi / 180.0;

/// The room as seen from one pose, and everything the search makes of it.
struct View {
  Camera camera = testing::RoomCamera();
  Rigid3 pose = LookAlong({-1.0, 0.3, 0.2}, {1.0, 0.4, -0.1});
  std::vector<SearchLine> lines;
  std::vector<Segment2> segments;
  LineSamples samples;
  DirectionField field;

  explicit View(int cell_px = 2) {
    for (const Segment3& line : testing::RoomLines()) lines.push_back({line, 1.0});
    segments = testing::Render(
        testing::RoomLines(), pose, 1,
        {.noise_px = 0.0, .missing_share = 0.0, .fragment_share = 0.0, .num_clutter = 0});
    SampleLines(camera, pose, lines, &samples);
    field.Assign(camera.width_px, camera.height_px, segments, {cell_px, 0.2});
  }

  float Score(const RelativePose& at, double sigma_px = 6.0) {
    FieldScorer scorer;
    scorer.Prepare(camera, field, sigma_px);
    return scorer.Score(at, samples);
  }
};

struct Sample {
  Eigen::Vector3d point, direction;
  double weight;
};

/// Every slot of the groups, padding included.
std::vector<Sample> SlotsOf(const LineSamples& samples) {
  std::vector<Sample> slots;
  const LineSamples::Columns& c = samples.columns;
  for (size_t group = 0; group < samples.group_samples.size(); ++group) {
    for (uint32_t k = 0; k < samples.group_samples[group]; ++k) {
      for (size_t lane = 0; lane < LineSamples::kLanes; ++lane) {
        const size_t i = group * LineSamples::kLanes + lane;
        const Eigen::Vector3d step(c.step_x[i], c.step_y[i], c.step_z[i]);
        slots.push_back({Eigen::Vector3d(c.x[i], c.y[i], c.z[i]) + k * step, step.normalized(),
                         static_cast<double>(c.weight[i])});
      }
    }
  }
  return slots;
}

RelativePose Moved(const Eigen::Vector3d& w, const Eigen::Vector3d& v) {
  return {ExpSo3(w).toRotationMatrix().cast<float>(), v.cast<float>()};
}

TEST(LineSamples, AreOnTheirLinesWithWeightsOfOne) {
  View view;
  ASSERT_GT(view.samples.count, 50u);
  const std::vector<Sample> slots = SlotsOf(view.samples);
  EXPECT_EQ(slots.size(), view.samples.num_slots);
  double sum = 0.0;
  size_t count = 0;
  for (const Sample& sample : slots) {
    if (sample.weight == 0.0) continue;  // padding
    ++count;
    sum += sample.weight;
    const Eigen::Vector3d x = view.pose.Inverse() * sample.point;
    double nearest = 1.0;
    for (const SearchLine& line : view.lines) {
      const Eigen::Vector3d d = line.segment_in_world.Delta().normalized();
      nearest = std::min(nearest, (x - line.segment_in_world.start).cross(d).norm());
    }
    EXPECT_LT(nearest, 1e-5);
  }
  EXPECT_EQ(count, view.samples.count);
  EXPECT_NEAR(sum, 1.0, 1e-5);
}

TEST(LineSamples, LongLinesGetMoreSamples) {
  const Camera camera = testing::RoomCamera();
  const std::vector<SearchLine> lines = {{{{0, 0, 2}, {0.05, 0, 2}}, 1.0},    // 13 px
                                         {{{-1, 0.5, 2}, {1, 0.5, 2}}, 1.0},  // 525 px
                                         {{{0, 0, -2}, {1, 0, -2}}, 1.0}};    // behind
  LineSamples samples;
  SampleLines(camera, Rigid3{}, lines, &samples);
  EXPECT_EQ(samples.count, 5u);
}

TEST(LineSamples, EveryEighthHasLikeWeightsAndPlaces) {
  View view;
  LineSamples few;
  TakeEvery(view.samples, 8, &few);
  EXPECT_EQ(few.count, (view.samples.count + 3) / 8);
  double sum = 0.0;
  for (const Sample& sample : SlotsOf(few)) {
    if (sample.weight == 0.0) continue;
    sum += sample.weight;
    double nearest = 1.0;
    for (const Sample& other : SlotsOf(view.samples)) {
      if (other.weight > 0.0) nearest = std::min(nearest, (other.point - sample.point).norm());
    }
    EXPECT_LT(nearest, 1e-6);
  }
  EXPECT_NEAR(sum, 1.0, 1e-5);
}

TEST(FieldScore, IsHighAtTheTruth) {
  // Not one: lines that are cut by the border or shorter than 12 px were not detected.
  View view;
  EXPECT_GT(view.Score(RelativePose{}), 0.8f);
  View coarse(4);
  EXPECT_GT(coarse.Score(RelativePose{}, 20.0), 0.8f);
}

TEST(FieldScore, FallsWithTheErrorInEveryDirection) {
  View view;
  const float at_truth = view.Score(RelativePose{});
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const Eigen::Vector3d unit = sign * Eigen::Vector3d::Unit(axis);
      const float turned = view.Score(Moved(3.0 * kDegree * unit, Eigen::Vector3d::Zero()));
      const float moved = view.Score(Moved(Eigen::Vector3d::Zero(), 0.15 * unit));
      EXPECT_LT(turned, at_truth - 0.2f) << "turn about axis " << axis;
      EXPECT_LT(moved, at_truth - 0.1f) << "shift along axis " << axis;
    }
  }
}

TEST(FieldScore, EqualsItsDefinition) {
  View view;
  const RelativePose at = Moved({0.01, -0.02, 0.015}, {0.03, -0.02, 0.05});
  const double sigma = 6.0;
  double support = 0.0, inside = 0.0, total = 0.0;
  for (const Sample& sample : SlotsOf(view.samples)) {
    const Eigen::Matrix3d rotation = at.rotation.cast<double>();
    const Eigen::Vector3d x = rotation * sample.point + at.translation.cast<double>();
    const Eigen::Vector3d d = rotation * sample.direction;
    total += sample.weight;
    if (x.z() <= 0.1) continue;
    const Eigen::Vector2d pixel = view.camera.Project(x);
    const double column = std::floor(pixel.x() / 2 + view.field.border_cells() + 0.5);
    const double row = std::floor(pixel.y() / 2 + view.field.border_cells() + 0.5);
    if (column < 1 || row < 1 || column >= view.field.width() - 1 ||
        row >= view.field.height() - 1) {
      continue;
    }
    double angle = std::atan2(d.y() - x.y() / x.z() * d.z(), d.x() - x.x() / x.z() * d.z());
    if (angle < 0.0) angle += std::numbers::pi;
    const int channel = static_cast<int>(angle / std::numbers::pi * 16) % 16;
    const double r =
        view.field.At(static_cast<int>(row), static_cast<int>(column), channel) / sigma;
    inside += sample.weight;
    support += sample.weight / ((1 + r * r) * (1 + r * r));
  }
  // The quick arctangent moves a few samples to the next channel.
  EXPECT_NEAR(view.Score(at, sigma), support / (0.8 * inside + 0.2 * total), 0.02);
}

TEST(FieldScore, PosesThatSeeNothingGetNothing) {
  View view;
  EXPECT_EQ(view.Score(Moved({0, std::numbers::pi, 0}, {0, 0, -8})), 0.0f);
}

TEST(FieldAlignment, BringsThePoseIntoTheReachOfMatching) {
  View view;
  FieldAligner aligner;
  Random random(3);
  for (int trial = 0; trial < 10; ++trial) {
    const Eigen::Vector3d w = 1.5 * kDegree * random.Normal3(1.0f).cast<double>().normalized();
    const Eigen::Vector3d v = 0.06 * random.Normal3(1.0f).cast<double>().normalized();
    RelativePose pose = Moved(w, v);
    for (const double sigma : {20.0, 12.0, 6.0, 3.0}) {
      pose = aligner.Align(view.camera, view.field, view.samples, pose,
                           {.sigma_px = sigma, .num_steps = 4});
    }
    EXPECT_LT(pose.translation.norm(), 0.04) << "trial " << trial;
    EXPECT_LT(Eigen::AngleAxisf(pose.rotation).angle(), 0.8 * kDegree) << "trial " << trial;
  }
}

TEST(FieldAlignment, WithoutSegmentsThePriorFactorBringsItHome) {
  View view;
  view.field.Assign(view.camera.width_px, view.camera.height_px, {}, {2, 0.2});
  FieldAligner aligner;
  const RelativePose pose =
      aligner.Align(view.camera, view.field, view.samples, Moved({0.02, 0, 0}, {0, 0.1, 0}),
                    {.sigma_px = 12.0, .num_steps = 3});
  EXPECT_LT(pose.translation.norm(), 1e-4);
  EXPECT_LT(Eigen::AngleAxisf(pose.rotation).angle(), 1e-3);
}

TEST(RelativePose, ComposesWithTheReferencePose) {
  const Rigid3 reference = LookAlong({1, 2, 3}, {0.3, 1, 0.1});
  const Vector6d delta = (Vector6d() << 0.1, -0.05, 0.02, 0.3, -0.2, 0.1).finished();
  const Rigid3 expected = Perturb(reference, delta);
  const PoseDistance distance =
      DistanceBetween(Moved(delta.head<3>(), delta.tail<3>()).After(reference), expected);
  EXPECT_LT(distance.position_m, 1e-6);
  EXPECT_LT(distance.rotation_rad, 1e-6);
}

}  // namespace
}  // namespace plumb
