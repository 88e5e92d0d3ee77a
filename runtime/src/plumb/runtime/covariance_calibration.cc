#include "plumb/runtime/covariance_calibration.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include <Eigen/Cholesky>

#include "plumb/map/map_index.h"

namespace plumb {
namespace {

constexpr double kPositionSigmaM = 0.10;
constexpr double kRotationSigmaRad = 0.0349;
constexpr double kMedianOfChiSquare6 = 5.348;

// The sigmas are norms of whole vectors: a third of the variance for each component.
Rigid3 Disturb(const Rigid3& cam_from_world, std::mt19937_64* random) {
  std::normal_distribution<double> normal;
  const auto vector = [&](double sigma) {
    const double x = normal(*random), y = normal(*random), z = normal(*random);
    return Eigen::Vector3d(sigma / std::sqrt(3.0) * Eigen::Vector3d(x, y, z));
  };
  const Eigen::Vector3d center = cam_from_world.Center() + vector(kPositionSigmaM);
  const Eigen::Quaterniond rotation =
      (ExpSo3(vector(kRotationSigmaRad)) * cam_from_world.rotation).normalized();
  return {rotation, -(rotation * center)};
}

}  // namespace

Result<CovarianceCalibration> CalibrateCovariance(const LineMap& map,
                                                  std::span<const HeldOutFrame> frames,
                                                  const PoseRefinerOptions& options) {
  const MapIndex index(map);
  Result<std::unique_ptr<PoseRefiner>> refiner = PoseRefiner::Create(index, options);
  if (!refiner) return refiner.error();

  std::mt19937_64 random(options.seed + 1);
  std::vector<double> square_errors;
  RefineResult result;
  for (size_t i = 0; i < frames.size(); ++i) {
    RefineInput input;
    input.camera = frames[i].camera;
    input.segments = frames[i].segments;
    input.prior = {Disturb(frames[i].cam_from_world, &random), kPositionSigmaM, kRotationSigmaRad};
    input.seed = i;
    if (const Status refined = (*refiner)->Refine(input, &result); !refined) {
      return refined.error();
    }
    if (result.status != RefineStatus::kRefined) continue;
    const Vector6d error = Difference(frames[i].cam_from_world, result.cam_from_world);
    square_errors.push_back(error.dot(result.covariance.ldlt().solve(error)));
  }

  CovarianceCalibration calibration{map.covariance_factor, square_errors.size()};
  if (square_errors.size() < kMinCalibrationFrames) return calibration;
  const auto middle = square_errors.begin() + static_cast<long>(square_errors.size() / 2);
  std::nth_element(square_errors.begin(), middle, square_errors.end());
  const double ratio = *middle / kMedianOfChiSquare6;
  // Errors of exactly 0 happen only on synthetic data without noise.
  if (ratio > 0.0 && std::isfinite(ratio)) calibration.factor *= ratio;
  return calibration;
}

}  // namespace plumb
