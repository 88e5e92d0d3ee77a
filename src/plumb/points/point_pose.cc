#include "plumb/points/point_pose.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstddef>
#include <opencv2/calib3d.hpp>

#include "plumb/base/median.h"
#include "plumb/geometry/line_projection.h"

namespace plumb {
namespace {

constexpr int kIterations = 12;
constexpr double kMaxStepRad = 0.1;
constexpr double kMedianChiSquare2 = 1.386;  // of a chi-square with 2 degrees of freedom
constexpr double kMinScale = 0.09;           // never trust residuals below 0.3 sigma

/// One match in the normal equations.
struct PointTerm {
  Eigen::Matrix<double, 2, 6> jacobian;  // by the left perturbation (rotation, translation)
  Eigen::Matrix2d information;
  Eigen::Vector2d residual;
  double square = 0.0;  // Mahalanobis
};

std::optional<PointTerm> Evaluate(const Camera& camera, const PointCorrespondence& match,
                                  double pixel_sigma_px, const Rigid3& cam_from_world) {
  const Eigen::Vector3d point = cam_from_world * match.point_in_world;
  if (!(point.z() > kNearPlane)) return std::nullopt;
  Eigen::Matrix<double, 2, 3> by_point;
  by_point << camera.fx, 0.0, -camera.fx * point.x() / point.z(),  //
      0.0, camera.fy, -camera.fy * point.y() / point.z();
  by_point /= point.z();
  PointTerm term;
  term.jacobian << by_point * -Hat(cam_from_world.rotation * match.point_in_world), by_point;
  const Eigen::Vector2d spread = by_point * (cam_from_world.rotation * match.deviation_in_world);
  term.information =
      (pixel_sigma_px * pixel_sigma_px * Eigen::Matrix2d::Identity() + spread * spread.transpose())
          .inverse();
  term.residual = camera.Project(point) - match.pixel;
  term.square = term.residual.dot(term.information * term.residual);
  return term;
}

}  // namespace

Rigid3 RefinePointPose(const Camera& camera, std::span<const PointCorrespondence> matches,
                       double pixel_sigma_px, const Rigid3& cam_from_world) {
  Rigid3 pose = cam_from_world;
  std::vector<PointTerm> terms;
  std::vector<double> squares;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    terms.clear();
    squares.clear();
    for (const PointCorrespondence& match : matches) {
      if (const auto term = Evaluate(camera, match, pixel_sigma_px, pose)) {
        terms.push_back(*term);
        squares.push_back(term->square);
      }
    }
    if (terms.empty()) return pose;
    const double scale = std::max(Median(squares) / kMedianChiSquare2, kMinScale);
    Matrix6d information = 1e-6 * Matrix6d::Identity();
    Vector6d gradient = Vector6d::Zero();
    for (const PointTerm& term : terms) {
      const double root = 1.0 + term.square / scale / 9.0;
      const Eigen::Matrix<double, 6, 2> weighted =
          term.jacobian.transpose() * term.information / (scale * root * root);
      information += weighted * term.jacobian;
      gradient += weighted * term.residual;
    }
    Vector6d step = -information.ldlt().solve(gradient);
    if (!step.allFinite()) return pose;
    const double rotation = step.head<3>().norm();
    if (rotation > kMaxStepRad) step *= kMaxStepRad / rotation;
    pose = Perturb(pose, step);
    if (step.norm() < 1e-9) break;
  }
  return pose;
}

std::optional<PointPose> EstimatePointPose(const Camera& camera,
                                           std::span<const PointCorrespondence> matches,
                                           const PointPoseOptions& options) {
  if (!camera.IsValid() || matches.size() < options.min_inliers) return std::nullopt;
  // On the plane z = 1, so that mirrored cameras need no care.
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> images;
  for (const PointCorrespondence& match : matches) {
    const Eigen::Vector2d image = camera.Normalize(match.pixel);
    points.emplace_back(match.point_in_world.x(), match.point_in_world.y(),
                        match.point_in_world.z());
    images.emplace_back(image.x(), image.y());
  }
  cv::Mat rotation_vector, translation, inliers;
  try {
    const bool found = cv::solvePnPRansac(
        points, images, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation_vector, translation,
        /*useExtrinsicGuess=*/false, options.max_iterations,
        static_cast<float>(options.max_error_px / camera.MeanFocal()), options.confidence, inliers,
        cv::SOLVEPNP_EPNP);
    if (!found) return std::nullopt;
  } catch (const cv::Exception&) {  // degenerate points
    return std::nullopt;
  }
  if (inliers.total() < options.min_inliers) return std::nullopt;

  PointPose result;
  const auto at = [](const cv::Mat& vector) {
    return Eigen::Vector3d(vector.at<double>(0), vector.at<double>(1), vector.at<double>(2));
  };
  result.cam_from_world = {ExpSo3(at(rotation_vector)), at(translation)};
  if (!result.cam_from_world.IsFinite()) return std::nullopt;
  std::vector<PointCorrespondence> kept;
  for (size_t i = 0; i < inliers.total(); ++i) {
    result.inliers.push_back(static_cast<uint32_t>(inliers.at<int>(static_cast<int>(i))));
  }
  std::sort(result.inliers.begin(), result.inliers.end());
  for (const uint32_t i : result.inliers) kept.push_back(matches[i]);
  result.cam_from_world =
      RefinePointPose(camera, kept, options.pixel_sigma_px, result.cam_from_world);
  return result;
}

}  // namespace plumb
