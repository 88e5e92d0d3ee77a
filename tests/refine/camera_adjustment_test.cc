// A camera that is given wrongly is found again from what it saw of a room.
#include "plumb/refine/camera_adjustment.h"

#include <array>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <ceres/cost_function.h>

#include <gtest/gtest.h>

#include "plumb/refine/cost/line_in_camera.h"
#include "support/synthetic_room.h"

namespace plumb {
namespace {

const ImageCamera kPinhole = testing::RoomCamera();

ImageCamera Camera525(LensModel model, double k1, double k2) {
  return {testing::RoomCamera(), {model, {k1, k2}}};
}

struct Scene {
  std::vector<Rigid3> poses;
  std::vector<Segment3> lines;
  std::vector<CameraSighting> sightings;
};

// Half a room seen by 36 views of `truth`, the ends of segments off by `noise_px`.
Scene MakeScene(const ImageCamera& truth, double noise_px) {
  std::mt19937 rng(5);
  std::normal_distribution<double> normal;
  const LensMapping mapping = *LensMapping::Create(truth.lens);
  Scene scene;
  scene.poses = testing::RoomSweep(36);
  const LineMap map = testing::MapOf(testing::RoomLines(), scene.poses);
  for (const MapLine& line : map.lines) {
    // Lines from depth images are near, not exact.
    const Eigen::Vector3d off = 0.01 * Eigen::Vector3d(normal(rng), normal(rng), normal(rng));
    scene.lines.push_back({line.segment_in_world.start + off, line.segment_in_world.end - off});
  }
  for (uint32_t k = 0; k < map.key_frames.size(); ++k) {
    for (const LiftedSegment& segment : map.key_frames[k].segments) {
      CameraSighting sighting{k, *segment.line, {}};
      bool is_imaged = true;
      for (const auto& [end, out] :
           {std::pair(segment.segment_in_world.start, &sighting.segment_px.start),
            std::pair(segment.segment_in_world.end, &sighting.segment_px.end)}) {
        const auto imaged = mapping.Distort((scene.poses[k] * end).hnormalized());
        is_imaged = is_imaged && imaged;
        if (!imaged) break;
        const Eigen::Vector2d noise(normal(rng), normal(rng));
        *out = noise_px * noise +
               Eigen::Vector2d(truth.pinhole.fx * imaged->point.x() + truth.pinhole.cx,
                               truth.pinhole.fy * imaged->point.y() + truth.pinhole.cy);
      }
      if (is_imaged) scene.sightings.push_back(sighting);
    }
  }
  return scene;
}

std::optional<AdjustedCamera> Adjust(const Scene& scene, const ImageCamera& start,
                                     const CameraAdjustmentOptions& options = {}) {
  return AdjustCamera(start, scene.poses, scene.lines, scene.sightings, options);
}

// All of what can change, of a camera without a lens or with one of either model.
class AdjustCameraFrom : public ::testing::TestWithParam<ImageCamera> {};

TEST_P(AdjustCameraFrom, FindsTheCameraThatTookTheViews) {
  const ImageCamera start = GetParam();
  ImageCamera truth = start;
  if (truth.lens.IsNone()) truth.lens.model = LensModel::kRadTan;
  truth.pinhole.fx *= 1.012;
  truth.pinhole.fy *= 1.012;
  truth.pinhole.cx += 3.0;
  truth.pinhole.cy -= 2.0;
  truth.lens.coefficients[0] += 0.03;
  truth.lens.coefficients[1] -= 0.05;
  const auto exact = Adjust(MakeScene(truth, 0.0), start);
  ASSERT_TRUE(exact);
  EXPECT_EQ(exact->camera.lens.model, truth.lens.model);
  EXPECT_NEAR(exact->camera.pinhole.fx, truth.pinhole.fx, 0.05);
  EXPECT_NEAR(exact->camera.pinhole.fy, truth.pinhole.fy, 0.05);
  EXPECT_NEAR(exact->camera.pinhole.cx, truth.pinhole.cx, 0.05);
  EXPECT_NEAR(exact->camera.pinhole.cy, truth.pinhole.cy, 0.05);
  EXPECT_NEAR(exact->camera.lens.coefficients[0], truth.lens.coefficients[0], 1e-3);
  EXPECT_NEAR(exact->camera.lens.coefficients[1], truth.lens.coefficients[1], 3e-3);

  const auto noisy = Adjust(MakeScene(truth, 0.35), start);
  ASSERT_TRUE(noisy);
  EXPECT_NEAR(noisy->camera.pinhole.fx, truth.pinhole.fx, 0.5);
  EXPECT_NEAR(noisy->camera.pinhole.cx, truth.pinhole.cx, 0.5);
  EXPECT_NEAR(noisy->camera.pinhole.cy, truth.pinhole.cy, 0.5);
  EXPECT_NEAR(noisy->camera.lens.coefficients[0], truth.lens.coefficients[0], 5e-3);
}

INSTANTIATE_TEST_SUITE_P(Lenses, AdjustCameraFrom,
                         ::testing::Values(kPinhole, Camera525(LensModel::kRadTan, -0.2, 0.05),
                                           Camera525(LensModel::kKannalaBrandt, 0.05, 0.01)));

TEST(AdjustCamera, AFixedCameraCostsMoreThanTheRightOne) {
  const ImageCamera truth = Camera525(LensModel::kRadTan, 0.03, 0.0);
  const Scene scene = MakeScene(truth, 0.35);
  CameraAdjustmentOptions fixed;
  fixed.camera_is_fixed = true;
  const auto wrong = Adjust(scene, kPinhole, fixed), right = Adjust(scene, truth, fixed);
  ASSERT_TRUE(wrong && right);
  EXPECT_EQ(wrong->camera.pinhole, kPinhole.pinhole);
  EXPECT_EQ(right->camera, truth);
  EXPECT_GT(wrong->cost, right->cost + 100.0);
  // Ends are off by the deviation that is assumed: half a square a residual, less what lines take.
  EXPECT_LT(right->cost, static_cast<double>(scene.sightings.size()));
}

// A lens that images less must not look better for it.
TEST(AdjustCamera, CountsWhatTheCameraCanHaveImaged) {
  const Scene scene = MakeScene(kPinhole, 0.0);
  CameraAdjustmentOptions fixed;
  fixed.camera_is_fixed = true;
  const auto all = Adjust(scene, kPinhole, fixed);
  const auto barrel = Adjust(scene, Camera525(LensModel::kRadTan, -0.9, 0.0), fixed);
  ASSERT_TRUE(all && barrel);
  EXPECT_EQ(all->num_sightings, scene.sightings.size());
  EXPECT_LT(barrel->num_sightings, scene.sightings.size());
}

TEST(AdjustCamera, OutliersDoNotMoveIt) {
  Scene scene = MakeScene(kPinhole, 0.35);
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> shift(-20.0, 20.0);
  for (size_t i = 0; i < scene.sightings.size(); i += 10) {
    scene.sightings[i].segment_px.start += Eigen::Vector2d(shift(rng), shift(rng));
  }
  const auto adjusted = Adjust(scene, kPinhole);
  ASSERT_TRUE(adjusted);
  EXPECT_NEAR(adjusted->camera.pinhole.fx, kPinhole.pinhole.fx, 0.5);
  EXPECT_NEAR(adjusted->camera.lens.coefficients[0], 0.0, 5e-3);
}

TEST(AdjustCamera, RefusesWhatItCannotUse) {
  const Scene scene = MakeScene(kPinhole, 0.0);
  EXPECT_FALSE(Adjust(scene, ImageCamera{}));
  EXPECT_FALSE(Adjust(scene, Camera525(LensModel::kRadTan, std::nan(""), 0.0)));
  const auto refuses = [&scene](auto&& change) {
    Scene changed = scene;
    CameraAdjustmentOptions options;
    change(&changed, &options);
    return !Adjust(changed, kPinhole, options);
  };
  using Options = CameraAdjustmentOptions;
  EXPECT_FALSE(refuses([](Scene*, Options*) {}));
  EXPECT_TRUE(refuses([](Scene* s, Options*) { s->sightings.clear(); }));
  EXPECT_TRUE(refuses([](Scene* s, Options*) { s->sightings[3].view = 36; }));
  EXPECT_TRUE(refuses([](Scene* s, Options*) { s->sightings[3].line = 100'000; }));
  EXPECT_TRUE(refuses([](Scene* s, Options*) {
    s->sightings[3].segment_px.end.x() = std::numeric_limits<double>::infinity();
  }));
  EXPECT_TRUE(refuses([](Scene* s, Options*) { s->poses[0].translation.x() = std::nan(""); }));
  EXPECT_TRUE(refuses([](Scene* s, Options*) { s->poses[0].rotation.coeffs() *= 2.0; }));
  EXPECT_TRUE(refuses([](Scene* s, Options*) { s->lines[0].start.z() = std::nan(""); }));
  EXPECT_TRUE(refuses([](Scene*, Options* o) { o->pixel_sigma_px = 0.0; }));
  EXPECT_TRUE(refuses([](Scene*, Options* o) { o->cauchy_scale = -1.0; }));
  EXPECT_TRUE(refuses([](Scene*, Options* o) { o->focal_sigma = 0.0; }));
  EXPECT_TRUE(refuses([](Scene*, Options* o) { o->centre_sigma = std::nan(""); }));
  EXPECT_TRUE(refuses([](Scene*, Options* o) { o->distortion_sigma = 0.0; }));
  EXPECT_TRUE(refuses([](Scene*, Options* o) { o->max_rounds = 0; }));
  EXPECT_TRUE(refuses([](Scene*, Options* o) { o->max_iterations = 0; }));
}

TEST(LineInCameraCost, JacobiansMatchDifferences) {
  const AnchoredSegment line = AnchorOf({{-0.4, 0.2, 2.0}, {0.7, -0.3, 2.5}});
  LinearRay start, end;
  start.normalized = {-0.19, 0.11};
  end.normalized = {0.27, -0.14};
  start.by_camera << 0.19, -1.0, 0.01, 0.009, 0.0004, -0.11, 0.02, -1.0, -0.005, -0.0003;
  end.by_camera << -0.27, -1.0, 0.01, -0.02, -0.002, 0.14, 0.02, -1.0, 0.01, 0.001;
  const std::unique_ptr<ceres::CostFunction> cost(
      LineInCameraCost::Create(line, {525.0, -520.0}, start, end, 0.35));
  std::array<double, kNumCameraChanges> changes = {0.01, -0.002, 0.003, 0.02, -0.01};
  std::array<double, 4> delta = {0.01, -0.02, 0.015, 0.03};
  const auto evaluate = [&](double** jacobians) {
    const double* blocks[] = {changes.data(), delta.data()};
    std::array<double, 2> residuals = {};
    EXPECT_TRUE(cost->Evaluate(blocks, residuals.data(), jacobians));
    return residuals;
  };
  std::array<double, 2 * kNumCameraChanges> by_changes = {};
  std::array<double, 8> by_delta = {};
  double* jacobians[] = {by_changes.data(), by_delta.data()};
  evaluate(jacobians);
  const auto expect_matches = [&](double* at, size_t count, const double* jacobian) {
    constexpr double kStep = 1e-6;
    for (size_t i = 0; i < count; ++i) {
      const double before = at[i];
      at[i] = before + kStep;
      const auto above = evaluate(nullptr);
      at[i] = before - kStep;
      const auto below = evaluate(nullptr);
      at[i] = before;
      for (size_t row = 0; row < 2; ++row) {
        const double difference = (above[row] - below[row]) / (2.0 * kStep);
        EXPECT_NEAR(jacobian[row * count + i], difference, 1e-4 * (1.0 + std::abs(difference)));
      }
    }
  };
  expect_matches(changes.data(), changes.size(), by_changes.data());
  expect_matches(delta.data(), delta.size(), by_delta.data());
}

TEST(LineInCameraCost, HasNoValueForALineThroughTheCamera) {
  const AnchoredSegment line = AnchorOf({{0.1, 0.2, 1.0}, {0.2, 0.4, 2.0}});
  const std::unique_ptr<ceres::CostFunction> cost(
      LineInCameraCost::Create(line, {525.0, 525.0}, LinearRay{}, LinearRay{}, 1.0));
  const std::array<double, kNumCameraChanges> changes = {};
  const std::array<double, 4> delta = {};
  const double* blocks[] = {changes.data(), delta.data()};
  std::array<double, 2> residuals = {};
  EXPECT_FALSE(cost->Evaluate(blocks, residuals.data(), nullptr));
}

}  // namespace
}  // namespace plumb
