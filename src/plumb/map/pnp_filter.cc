#include "plumb/map/pnp_filter.h"

#include <algorithm>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace plumb {
namespace {

constexpr size_t kMinimalSample = 4;  // P3P and one point to choose among its solutions

}  // namespace

std::vector<bool> PnpInliers(const Camera& camera, std::span<const PnpObservation> observations,
                             const PnpFilterOptions& options) {
  std::vector<bool> inliers(observations.size(), true);
  if (2 * observations.size() < std::max<size_t>(options.min_inliers, kMinimalSample)) {
    return inliers;
  }
  // Pixels of a camera without offset and mirrored axes: OpenCV's solvers assume positive focals.
  const double focal = camera.MeanFocal();
  std::vector<cv::Point2d> pixels;
  std::vector<cv::Point3d> points;
  for (const PnpObservation& observation : observations) {
    const Segment3& place = observation.predicted_in_world;
    for (const Eigen::Vector2d& end : {observation.segment_px.start, observation.segment_px.end}) {
      const Eigen::Vector2d at = focal * camera.Normalize(end);
      pixels.emplace_back(at.x(), at.y());
    }
    for (const Eigen::Vector3d& end : {place.start, place.end}) {
      points.emplace_back(end.x(), end.y(), end.z());
    }
  }
  const cv::Matx33d intrinsics(focal, 0, 0, 0, focal, 0, 0, 0, 1);
  cv::Vec3d rotation, translation;
  std::vector<int> consensus;
  std::vector<cv::Point2d> projected;
  try {
    // Its generator is seeded with a constant: the result is reproducible.
    if (!cv::solvePnPRansac(points, pixels, intrinsics, cv::noArray(), rotation, translation, false,
                            options.iterations, static_cast<float>(options.threshold_px),
                            options.confidence, consensus, cv::SOLVEPNP_AP3P) ||
        consensus.size() < options.min_inliers) {
      return inliers;
    }
    // A minimal sample's pose wobbles by about the threshold: polish, then decide.
    std::vector<cv::Point2d> good_pixels;
    std::vector<cv::Point3d> good_points;
    for (const int i : consensus) {
      good_pixels.push_back(pixels[i]);
      good_points.push_back(points[i]);
    }
    cv::solvePnPRefineLM(good_points, good_pixels, intrinsics, cv::noArray(), rotation,
                         translation);
    cv::projectPoints(points, rotation, translation, intrinsics, cv::noArray(), projected);
  } catch (const cv::Exception&) {
    return inliers;  // A degenerate sample; the frame says nothing.
  }
  for (size_t i = 0; i < observations.size(); ++i) {
    const auto is_inlier = [&](size_t k) {
      return cv::norm(projected[k] - pixels[k]) < options.threshold_px;
    };
    inliers[i] = is_inlier(2 * i) && is_inlier(2 * i + 1);
  }
  return inliers;
}

}  // namespace plumb
