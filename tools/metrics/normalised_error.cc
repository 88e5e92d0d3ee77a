#include "tools/metrics/normalised_error.h"

#include <numeric>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>

#include "tools/metrics/percentile.h"

namespace plumb::tools {
namespace {

constexpr double kMedianOfChiSquare3 = 2.366, kMedianOfChiSquare6 = 5.348;

template <int N>
std::optional<double> SquareOf(const Eigen::Matrix<double, N, 1>& error,
                               const Eigen::Matrix<double, N, N>& covariance) {
  const Eigen::LLT<Eigen::Matrix<double, N, N>> cholesky(covariance);
  if (cholesky.info() != Eigen::Success) return std::nullopt;
  return error.dot(cholesky.solve(error));
}

NormalisedError Summarize(const std::vector<double>& squares, double median, double mean) {
  if (squares.empty()) return {};
  const double sum = std::accumulate(squares.begin(), squares.end(), 0.0);
  return {Percentile(squares, 50.0) / median, sum / static_cast<double>(squares.size()) / mean};
}

}  // namespace

NormalisedErrors EvaluateCovariances(std::span<const PoseWithCovariance> frames) {
  std::vector<double> pose, rotation, position;
  for (const PoseWithCovariance& frame : frames) {
    const Vector6d error = Difference(frame.true_cam_from_world, frame.refined_cam_from_world);
    // The centre -R^T t moves by -R^T v.
    const Eigen::Matrix3d turn = frame.refined_cam_from_world.RotationMatrix();
    const Eigen::Matrix3d of_center =
        turn.transpose() * frame.covariance.bottomRightCorner<3, 3>() * turn;
    const Eigen::Vector3d moved =
        frame.true_cam_from_world.Center() - frame.refined_cam_from_world.Center();
    const auto whole = SquareOf<6>(error, frame.covariance);
    const auto turned = SquareOf<3>(error.head<3>(), frame.covariance.topLeftCorner<3, 3>());
    const auto shifted = SquareOf<3>(moved, of_center);
    if (!whole || !turned || !shifted) continue;
    pose.push_back(*whole);
    rotation.push_back(*turned);
    position.push_back(*shifted);
  }
  return {pose.size(), Summarize(pose, kMedianOfChiSquare6, 6.0),
          Summarize(rotation, kMedianOfChiSquare3, 3.0),
          Summarize(position, kMedianOfChiSquare3, 3.0)};
}

}  // namespace plumb::tools
