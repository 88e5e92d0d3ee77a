// A staircase looks the same one step further: a real localiser's pose there, off by a step, must
// not come out as a confident answer. Skipped when the data is not there.
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "plumb/features/lsd_detector.h"
#include "plumb/features/segment_refiner.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb {
namespace {

const std::filesystem::path kRoot = "../shared/data/correspondences";

Rigid3 ParsePose(const nlohmann::json& json) {
  const auto q = json["q_wxyz"].get<std::vector<double>>();
  const auto t = json["t"].get<std::vector<double>>();
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized(), {t[0], t[1], t[2]}};
}

/// One query of 7-Scenes stairs with another system's line map, which has neither covariances nor
/// key frames: every line counts as seen from the coarse pose.
class Stairs : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kRoot / "stairs_1.json")) GTEST_SKIP() << kRoot << " is not there";
    std::ifstream file(kRoot / "stairs_1.json");
    const nlohmann::json json = nlohmann::json::parse(file);
    camera_ = {json["fx"].get<double>(), json["fy"].get<double>(), json["cx"].get<double>(),
               json["cy"].get<double>(), json["width"].get<int>(), json["height"].get<int>()};
    truth_ = ParsePose(json["truth_cam_from_world"]);
    coarse_ = ParsePose(json["coarse_cam_from_world"]);
    for (const auto& line : json["map_lines"]) {
      const auto v = line.get<std::vector<double>>();
      MapLine& added = map_.lines.emplace_back();
      added.segment_in_world = {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
      const Eigen::Vector3d along = added.segment_in_world.Delta().normalized();
      added.covariance_start = added.covariance_end =
          kMapSigmaM * kMapSigmaM * (Eigen::Matrix3d::Identity() - along * along.transpose());
      added.num_observing = added.num_expected = 3;
      const Eigen::Vector3d ray = coarse_.Center() - added.segment_in_world.Midpoint();
      map_.sightings.push_back({0, ray.normalized().cast<float>(), static_cast<float>(ray.norm())});
      map_.sighting_begin.push_back(static_cast<uint32_t>(map_.sightings.size()));
    }
    KeyFrame& key_frame = map_.key_frames.emplace_back();
    key_frame.cam_from_world = coarse_;
    key_frame.camera = camera_;
    for (const auto& point : json["points"]) {
      const auto xy = point["xy"].get<std::vector<double>>();
      const auto xyz = point["xyz"].get<std::vector<double>>();
      PointMatch& match = points_.emplace_back();
      match.pixel = {xy[0], xy[1]};
      match.point_in_world = {xyz[0], xyz[1], xyz[2]};
    }
    const cv::Mat gray = cv::imread(kRoot / "stairs_1.png", cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(gray.empty());
    ImageView view;
    view.width_px = gray.cols;
    view.height_px = gray.rows;
    view.planes[0] = {gray.data, static_cast<int64_t>(gray.step)};
    const auto raw = CreateLsdDetector()->Detect(view);
    ASSERT_TRUE(raw.has_value());
    segments_ = SegmentRefiner{SegmentRefinerOptions()}.Refine(view, *raw);
    index_ = std::make_unique<MapIndex>(map_);
    auto refiner = PoseRefiner::Create(*index_, {});
    ASSERT_TRUE(refiner.has_value());
    refiner_ = *std::move(refiner);
  }

  RefineResult Refine(const Rigid3& prior, double sigma_m, double sigma_deg, bool with_points,
                      uint64_t seed) {
    RefineInput input;
    input.camera = camera_;
    input.segments = segments_;
    input.prior = {prior, sigma_m, sigma_deg * std::numbers::pi / 180.0};
    if (with_points) input.points = points_;
    input.seed = seed;
    RefineResult result;
    const Status status = refiner_->Refine(input, &result);
    EXPECT_TRUE(status) << status.error().message;
    return result;
  }

  double ErrorM(const RefineResult& result) const {
    return DistanceBetween(result.cam_from_world, truth_).position_m;
  }

  static constexpr double kMapSigmaM = 0.01;
  Camera camera_;
  Rigid3 truth_, coarse_;
  LineMap map_;
  std::vector<Segment2> segments_;
  std::vector<PointMatch> points_;
  std::unique_ptr<MapIndex> index_;
  std::unique_ptr<PoseRefiner> refiner_;
};

TEST_F(Stairs, AStepOffIsNoConfidentAnswer) {
  ASSERT_NEAR(DistanceBetween(coarse_, truth_).position_m, 0.33, 0.01);
  for (const bool with_points : {false, true}) {
    for (const double sigma_m : {0.1, 0.2, 0.33, 0.4}) {
      for (uint64_t seed = 0; seed < 10; ++seed) {
        const RefineResult result = Refine(coarse_, sigma_m, 20.0 * sigma_m, with_points, seed);
        if (result.status != RefineStatus::kRefined) continue;
        EXPECT_LT(ErrorM(result), 0.05)
            << "points " << with_points << ", sigma " << sigma_m << " m, seed " << seed;
      }
    }
  }
}

TEST_F(Stairs, ASmallDisplacementComesBack) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto direction = [&]() -> Eigen::Vector3d {
    return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  for (const bool with_points : {false, true}) {
    for (uint64_t trial = 0; trial < 20; ++trial) {
      const Eigen::Quaterniond rotation =
          (ExpSo3(0.5 * std::numbers::pi / 180.0 * direction()) * truth_.rotation).normalized();
      const Eigen::Vector3d center = truth_.Center() + 0.02 * direction();
      const RefineResult result =
          Refine({rotation, -(rotation * center)}, 0.02, 0.5, with_points, trial);
      EXPECT_LT(ErrorM(result), 0.03)
          << ToString(result.status) << ", points " << with_points << ", trial " << trial;
    }
  }
}

}  // namespace
}  // namespace plumb
