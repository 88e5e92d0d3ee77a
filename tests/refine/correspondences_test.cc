// Given 2D-3D correspondences of other people's reconstructions (Oxford VGG), a pose that was moved
// must come back. Skipped when the data is not there.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "plumb/refine/joint_solver.h"

namespace plumb {
namespace {

const std::filesystem::path kRoot = "../shared/data/correspondences";
constexpr double kDisplacementShare = 0.02, kDisplacementDeg = 2.0;
constexpr int kTrialsPerView = 20;
constexpr double kConvergedPx = 0.35;
// The lines are fits to long edges, nearer to the truth than points are: 0.07 to 0.28 px (median)
// from where they alone put the camera.
constexpr double kLineVariancePx2 = 0.14 * 0.14;

struct View {
  Camera camera;
  Rigid3 cam_from_world;
  std::vector<LineObservation> lines;
  std::vector<PointObservation> points;
  double depth = 0.0;  // median of the lines'
};

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Eigen::Vector3d Vector3(const nlohmann::json& v, size_t begin = 0) {
  return {v[begin].get<double>(), v[begin + 1].get<double>(), v[begin + 2].get<double>()};
}

/// The skew goes from the camera into the pixels: x - (K01 / K11) (y - cy).
View ReadView(const nlohmann::json& scene, const nlohmann::json& json) {
  View view;
  const auto k = [&](size_t i, size_t j) { return json["K"][i][j].get<double>(); };
  view.camera = {k(0, 0),
                 k(1, 1),
                 k(0, 2),
                 k(1, 2),
                 static_cast<int>(2.0 * k(0, 2)) + 1,
                 static_cast<int>(2.0 * k(1, 2)) + 1};
  const auto pixel = [&](const nlohmann::json& v, size_t begin = 0) {
    const double y = v[begin + 1].get<double>();
    return Eigen::Vector2d(v[begin].get<double>() - k(0, 1) / k(1, 1) * (y - k(1, 2)), y);
  };
  Eigen::Matrix3d rotation;
  for (size_t i = 0; i < 3; ++i)
    rotation.row(static_cast<int>(i)) = Vector3(json["R_cam_from_world"][i]);
  view.cam_from_world = {Eigen::Quaterniond(rotation).normalized(),
                         Vector3(json["t_cam_from_world"])};
  std::vector<double> depths;
  for (const auto& line : json["lines"]) {
    const auto& ends = scene["lines3d"][line["id"].get<size_t>()];
    const Segment3 in_world{Vector3(ends), Vector3(ends, 3)};
    depths.push_back((view.cam_from_world * in_world.Midpoint()).z());
    view.lines.push_back(
        {in_world, {pixel(line["xyxy"]), pixel(line["xyxy"], 2)}, 1.0, kLineVariancePx2});
  }
  for (const auto& point : json["points"]) {
    PointObservation& observation = view.points.emplace_back();
    observation.pixel = pixel(point["xy"]);
    observation.point_in_world = Vector3(scene["points3d"][point["id"].get<size_t>()]);
  }
  view.depth = Median(depths);
  return view;
}

/// Median over both ends of every segment.
double PerpendicularPx(const View& view, const Rigid3& pose) {
  std::vector<double> distances;
  for (const LineObservation& line : view.lines) {
    for (const Eigen::Vector2d& end : {line.part_px.start, line.part_px.end}) {
      const auto distance = DistanceToLine(view.camera, pose * line.line_in_world.start,
                                           pose * line.line_in_world.end, end);
      distances.push_back(distance ? std::abs(distance->residual_px) : 1e3);
    }
  }
  return Median(distances);
}

/// Wide loss first: the displacement moves the image by tens of pixels. None of the lines is wrong,
/// so their loss stays wide.
Rigid3 Solve(const View& view, Rigid3 pose, bool with_points) {
  for (const double robust : {100.0, 10.0, 3.0}) {
    const auto solution = SolveOverlapCost(
        view.camera, pose, view.lines,
        with_points ? std::span<const PointObservation>(view.points)
                    : std::span<const PointObservation>(),
        nullptr,
        {.line_robust = std::max(robust, 10.0), .point_robust = robust, .max_iterations = 50});
    if (!solution) return pose;
    pose = solution->cam_from_world;
  }
  return pose;
}

class VggScene : public ::testing::TestWithParam<const char*> {};

TEST_P(VggScene, ADisplacedPoseComesBack) {
  const std::filesystem::path path = kRoot / GetParam();
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  std::ifstream file(path);
  const nlohmann::json scene = nlohmann::json::parse(file);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto direction = [&]() -> Eigen::Vector3d {
    return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  int trials = 0, converged_lines = 0, converged_joint = 0;
  for (const auto& json : scene["views"]) {
    const View view = ReadView(scene, json);
    for (int trial = 0; trial < kTrialsPerView; ++trial, ++trials) {
      const Rigid3& pose = view.cam_from_world;
      const Eigen::Quaterniond rotation =
          (ExpSo3(kDisplacementDeg * std::numbers::pi / 180.0 * direction()) * pose.rotation)
              .normalized();
      const Eigen::Vector3d center = pose.Center() + kDisplacementShare * view.depth * direction();
      const Rigid3 start{rotation, -(rotation * center)};
      EXPECT_GT(PerpendicularPx(view, start), 1.0);
      const double lines = PerpendicularPx(view, Solve(view, start, false));
      const double joint = PerpendicularPx(view, Solve(view, start, true));
      converged_lines += lines <= kConvergedPx;
      converged_joint += joint <= kConvergedPx;
    }
  }
  EXPECT_GE(converged_lines, 0.99 * trials) << "of " << trials;
  EXPECT_GE(converged_joint, 0.995 * trials) << "of " << trials;
}

INSTANTIATE_TEST_SUITE_P(Vgg, VggScene,
                         ::testing::Values("vgg_corridor.json", "vgg_library.json",
                                           "vgg_model_house.json"),
                         [](const auto& scene) {
                           const std::string name = scene.param;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace plumb
