#include "plumb/refine/bundle.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include <ceres/cost_function.h>

#include <gtest/gtest.h>

#include "plumb/refine/cost/line_in_view.h"
#include "support/synthetic_room.h"

namespace plumb {
namespace {

constexpr double kPositionSigmaM = 0.005, kRotationSigmaRad = 0.1 * std::numbers::pi / 180.0;

// Half a room seen by 36 views; poses are priors, exact before Disturb().
struct Scene {
  std::vector<Rigid3> truth;
  std::vector<Segment3> lines;
  std::vector<BundleView> views;
  std::vector<BundleSighting> sightings;
};

Scene MakeScene(double noise_px, double depth_noise_m) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const LineMap map = testing::MapOf(testing::RoomLines(), testing::RoomSweep(36));
  Scene scene;
  for (const MapLine& line : map.lines) scene.lines.push_back(line.segment_in_world);
  for (uint32_t k = 0; k < map.key_frames.size(); ++k) {
    const KeyFrame& frame = map.key_frames[k];
    const Rigid3& pose = frame.cam_from_world;
    scene.truth.push_back(pose);
    scene.views.push_back({pose, pose, {frame.camera.fx, frame.camera.fy}});
    for (const LiftedSegment& segment : frame.segments) {
      Segment2 image = segment.segment_px;
      Segment3 lifted{pose * segment.segment_in_world.start, pose * segment.segment_in_world.end};
      for (Eigen::Vector2d* end : {&image.start, &image.end}) {
        *end += noise_px * Eigen::Vector2d(normal(random), normal(random));
      }
      for (Eigen::Vector3d* end : {&lifted.start, &lifted.end}) {
        *end *= 1.0 + depth_noise_m * normal(random) / end->norm();
      }
      scene.sightings.push_back(
          {k,
           *segment.line,
           {frame.camera.Normalize(image.start), frame.camera.Normalize(image.end)},
           lifted,
           0.02});
    }
  }
  return scene;
}

void Disturb(Scene* scene) {
  Random random(9);
  for (BundleView& view : scene->views) {
    // Deviations of the priors: norms of sqrt(3) of them.
    view.prior = view.start = testing::Disturb(view.prior, std::sqrt(3.0) * kPositionSigmaM,
                                               std::sqrt(3.0) * kRotationSigmaRad, &random);
  }
}

struct Errors {
  double position_m = 0.0, rotation_rad = 0.0;
};

Errors MedianErrors(const std::vector<Rigid3>& truth, const std::vector<Rigid3>& poses) {
  std::vector<double> position_m, rotation_rad;
  for (size_t k = 0; k < truth.size(); ++k) {
    const PoseDistance distance = DistanceBetween(truth[k], poses[k]);
    position_m.push_back(distance.position_m);
    rotation_rad.push_back(distance.rotation_rad);
  }
  std::sort(position_m.begin(), position_m.end());
  std::sort(rotation_rad.begin(), rotation_rad.end());
  return {position_m[truth.size() / 2], rotation_rad[truth.size() / 2]};
}

std::vector<Rigid3> Priors(const Scene& scene) {
  std::vector<Rigid3> priors;
  for (const BundleView& view : scene.views) priors.push_back(view.prior);
  return priors;
}

std::optional<Bundle> Adjust(const Scene& scene) {
  BundleOptions options;
  options.position_sigma_m = kPositionSigmaM;
  options.rotation_sigma_rad = kRotationSigmaRad;
  return AdjustBundle(scene.views, scene.lines, scene.sightings, options);
}

// Autodiff Jacobians against central differences in all eleven parameters.
void ExpectJacobiansMatch(ceres::CostFunction* raw) {
  const std::unique_ptr<ceres::CostFunction> cost(raw);
  const Eigen::Quaterniond rotation = ExpSo3({0.1, -0.2, 0.05});
  std::vector<double> parameters(11);  // q, t, delta
  Eigen::Vector4d::Map(parameters.data()) = rotation.coeffs();
  Eigen::Vector3d::Map(parameters.data() + 4) = Eigen::Vector3d(0.05, -0.1, 0.2);
  Eigen::Vector4d::Map(parameters.data() + 7) = Eigen::Vector4d(0.01, -0.02, 0.015, 0.03);
  const int sizes[] = {4, 3, 4}, begins[] = {0, 4, 7}, rows = cost->num_residuals();
  const auto evaluate = [&](const std::vector<double>& at, double** jacobians) {
    const double* blocks[] = {at.data(), at.data() + 4, at.data() + 7};
    std::vector<double> residuals(rows);
    EXPECT_TRUE(cost->Evaluate(blocks, residuals.data(), jacobians));
    return residuals;
  };
  std::vector<double> by_q(rows * 4), by_t(rows * 3), by_delta(rows * 4);
  double* jacobians[] = {by_q.data(), by_t.data(), by_delta.data()};
  evaluate(parameters, jacobians);
  constexpr double kStep = 1e-6;
  for (int block = 0; block < 3; ++block) {
    for (int i = 0; i < sizes[block]; ++i) {
      std::vector<double> high = parameters, low = parameters;
      high[begins[block] + i] += kStep;
      low[begins[block] + i] -= kStep;
      const auto above = evaluate(high, nullptr), below = evaluate(low, nullptr);
      for (int r = 0; r < rows; ++r) {
        const double numeric = (above[r] - below[r]) / (2 * kStep);
        EXPECT_NEAR(jacobians[block][r * sizes[block] + i], numeric,
                    1e-5 * (1.0 + std::abs(numeric)))
            << "residual " << r << ", block " << block << ", parameter " << i;
      }
    }
  }
}

const AnchoredSegment kLine = [] {
  AnchoredSegment line{{{-0.4, 0.3, 2.5}, {0.7, -0.2, 3.4}}, {}};
  const Eigen::Vector3d along = line.anchors_in_world.Delta().normalized();
  line.across.col(0) = along.cross(Eigen::Vector3d::UnitY()).normalized();
  line.across.col(1) = along.cross(line.across.col(0));
  return line;
}();

TEST(LineInViewCost, JacobianMatchesNumericDifferences) {
  ExpectJacobiansMatch(
      LineInViewCost::Create(kLine, {525.0, -480.0}, {{-0.2, 0.1}, {0.3, -0.1}}, 0.7));
}

TEST(LiftedPointCost, JacobianMatchesNumericDifferences) {
  ExpectJacobiansMatch(LiftedPointCost::Create(kLine, {0.1, 0.05, 2.9}, 0.02));
}

TEST(LineInViewCost, IsTheDistanceInPixels) {
  AnchoredSegment line{{{-1, 0, 2}, {1, 0, 2}}, Eigen::Matrix<double, 3, 2>::Zero()};
  const std::unique_ptr<ceres::CostFunction> cost(
      LineInViewCost::Create(line, {500.0, 400.0}, {{-0.2, 0.01}, {0.2, -0.02}}, 0.5));
  const double q[] = {0, 0, 0, 1}, t[] = {0, 0, 0}, delta[] = {0, 0, 0, 0};
  const double* blocks[] = {q, t, delta};
  double residuals[2];
  ASSERT_TRUE(cost->Evaluate(blocks, residuals, nullptr));
  EXPECT_NEAR(std::abs(residuals[0]), 0.01 * 400.0 / 0.5, 1e-9);
  EXPECT_NEAR(residuals[1], -2.0 * residuals[0], 1e-9);
}

TEST(AdjustBundle, NoisyPosesComeBack) {
  Scene scene = MakeScene(0.3, 0.015);
  Disturb(&scene);
  const std::optional<Bundle> bundle = Adjust(scene);
  ASSERT_TRUE(bundle);
  const Errors before = MedianErrors(scene.truth, Priors(scene));
  const Errors after = MedianErrors(scene.truth, bundle->cam_from_world);
  EXPECT_LT(after.position_m, before.position_m / 3.0);
  EXPECT_LT(after.rotation_rad, before.rotation_rad / 3.0);
  EXPECT_LT(bundle->final_cost, 0.5 * bundle->initial_cost);
}

TEST(AdjustBundle, ExactPosesStay) {
  const Scene exact = MakeScene(0.0, 0.0);
  const std::optional<Bundle> bundle = Adjust(exact);
  ASSERT_TRUE(bundle);
  for (size_t k = 0; k < exact.truth.size(); ++k) {
    EXPECT_LT(DistanceBetween(exact.truth[k], bundle->cam_from_world[k]).position_m, 1e-7);
  }
  const Scene noisy = MakeScene(0.3, 0.015);  // segments, not poses
  const std::optional<Bundle> moved = Adjust(noisy);
  ASSERT_TRUE(moved);
  const Errors after = MedianErrors(noisy.truth, moved->cam_from_world);
  EXPECT_LT(after.position_m, 0.4 * kPositionSigmaM);
  EXPECT_LT(after.rotation_rad, 0.4 * kRotationSigmaRad);
}

TEST(AdjustBundle, PriorsFixTheGauge) {
  Scene scene = MakeScene(0.3, 0.015);
  Disturb(&scene);
  const std::optional<Bundle> bundle = Adjust(scene);
  ASSERT_TRUE(bundle);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (size_t k = 0; k < scene.views.size(); ++k) {
    mean += bundle->cam_from_world[k].Center() - scene.views[k].prior.Center();
  }
  mean /= static_cast<double>(scene.views.size());
  EXPECT_LT(mean.norm(), 0.01 * kPositionSigmaM);

  // From a start that is moved as a whole, which no segment can see, the same poses are found.
  const Rigid3 moved_from_world{ExpSo3({0.002, -0.001, 0.001}), {0.01, 0.0, -0.02}};
  for (BundleView& view : scene.views) view.start = view.start * moved_from_world.Inverse();
  for (Segment3& line : scene.lines) {
    line = {moved_from_world * line.start, moved_from_world * line.end};
  }
  const std::optional<Bundle> other = Adjust(scene);
  ASSERT_TRUE(other);
  const Errors difference = MedianErrors(bundle->cam_from_world, other->cam_from_world);
  EXPECT_LT(difference.position_m, 0.02 * kPositionSigmaM);
  EXPECT_LT(difference.rotation_rad, 0.02 * kRotationSigmaRad);
}

TEST(AdjustBundle, WrongAssociationsAreOutvoted) {
  Scene scene = MakeScene(0.3, 0.015);
  for (size_t i = 0; i < scene.sightings.size(); i += 12) {
    const Eigen::Vector2d off(4.0 / 525.0, 4.0 / 525.0);
    Segment2& segment = scene.sightings[i].segment_normalized;
    segment = {segment.start + off, segment.end + off};
  }
  Disturb(&scene);
  const std::optional<Bundle> bundle = Adjust(scene);
  ASSERT_TRUE(bundle);
  const Errors before = MedianErrors(scene.truth, Priors(scene));
  const Errors after = MedianErrors(scene.truth, bundle->cam_from_world);
  EXPECT_LT(after.position_m, before.position_m / 2.5);
  EXPECT_LT(after.rotation_rad, before.rotation_rad / 2.5);
}

TEST(AdjustBundle, AViewWithoutSightingsStaysAtItsPrior) {
  Scene scene = MakeScene(0.3, 0.015);
  Disturb(&scene);
  std::erase_if(scene.sightings, [](const BundleSighting& s) { return s.view == 7; });
  const std::optional<Bundle> bundle = Adjust(scene);
  ASSERT_TRUE(bundle);
  EXPECT_LT(DistanceBetween(scene.views[7].prior, bundle->cam_from_world[7]).position_m, 1e-9);
}

TEST(AdjustBundle, LinesWithoutDepthAreHeldByTheirViews) {
  Scene scene = MakeScene(0.3, 0.0);
  for (BundleSighting& sighting : scene.sightings) sighting.lifted_in_cam.reset();
  Disturb(&scene);
  const std::optional<Bundle> bundle = Adjust(scene);
  ASSERT_TRUE(bundle);
  const Errors before = MedianErrors(scene.truth, Priors(scene));
  const Errors after = MedianErrors(scene.truth, bundle->cam_from_world);
  EXPECT_LT(after.position_m, before.position_m / 2.0);  // their scale is left to the priors
  EXPECT_LT(after.rotation_rad, before.rotation_rad / 3.0);
}

TEST(AdjustBundle, EqualInputsGiveEqualPoses) {
  Scene scene = MakeScene(0.3, 0.015);
  Disturb(&scene);
  const std::optional<Bundle> a = Adjust(scene), b = Adjust(scene);
  ASSERT_TRUE(a && b);
  for (size_t k = 0; k < scene.views.size(); ++k) {
    EXPECT_EQ(a->cam_from_world[k].translation, b->cam_from_world[k].translation);
    EXPECT_EQ(a->cam_from_world[k].rotation.coeffs(), b->cam_from_world[k].rotation.coeffs());
  }
}

TEST(AdjustBundle, RefusesInputOutOfRange) {
  const Scene scene = MakeScene(0.0, 0.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refuses = [&](const std::function<void(Scene*, BundleOptions*)>& change) {
    Scene changed = scene;
    BundleOptions options;
    change(&changed, &options);
    return !AdjustBundle(changed.views, changed.lines, changed.sightings, options);
  };
  EXPECT_TRUE(refuses([](Scene* s, BundleOptions*) { s->views.clear(); }));
  EXPECT_TRUE(refuses([&](Scene* s, BundleOptions*) { s->views[1].prior.translation.x() = nan; }));
  EXPECT_TRUE(refuses([](Scene* s, BundleOptions*) { s->views[1].start.rotation.w() += 1.0; }));
  EXPECT_TRUE(refuses([](Scene* s, BundleOptions*) { s->views[1].focal_px.x() = 0.0; }));
  EXPECT_TRUE(refuses([](Scene* s, BundleOptions*) { s->sightings[3].view = 1000; }));
  EXPECT_TRUE(refuses([](Scene* s, BundleOptions*) { s->sightings[3].line = 100'000; }));
  EXPECT_TRUE(refuses([](Scene* s, BundleOptions*) { s->sightings[3].depth_sigma_m = 0.0; }));
  EXPECT_TRUE(refuses([&](Scene* s, BundleOptions*) { s->lines[0].start.y() = nan; }));
  EXPECT_TRUE(refuses([](Scene*, BundleOptions* o) { o->position_sigma_m = 0.0; }));
  EXPECT_TRUE(refuses([&](Scene*, BundleOptions* o) { o->rotation_sigma_rad = nan; }));
  EXPECT_TRUE(refuses([](Scene*, BundleOptions* o) { o->max_iterations = 0; }));
}

}  // namespace
}  // namespace plumb
