// Camera pose from 2D-3D point matches, without a prior.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "plumb/geometry/camera.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/points/point_matcher.h"

namespace plumb {

struct PointPoseOptions {
  double max_error_px = 3.0;  // of an inlier
  int max_iterations = 2000;
  double confidence = 0.9999;
  size_t min_inliers = 6;
  double pixel_sigma_px = 0.7;  // of an image point, in the refinement
};

struct PointPose {
  Rigid3 cam_from_world;
  std::vector<uint32_t> inliers;  // indices of the matches that RANSAC's pose explains, ascending
};

/// EPnP in RANSAC, then robust Gauss-Newton on the inliers that knows the points' depth deviations.
/// A coarse pose: at wide baselines the inliers prefer a biased subset, so joint refinement takes
/// all matches near the lines' pose instead. Deterministic.
/// @return nullopt without a consensus of `min_inliers`.
/// Source: Lepetit et al., IJCV 2009.
std::optional<PointPose> EstimatePointPose(const Camera& camera,
                                           std::span<const PointCorrespondence> matches,
                                           const PointPoseOptions& options = {});

/// The refinement alone, from `cam_from_world`: residual covariance pixel_sigma_px^2 I + j j^T with
/// j the image of the deviation, scaled by the median, Geman-McClure at 3 sigma. Matches that are
/// not in front of the camera are left out.
Rigid3 RefinePointPose(const Camera& camera, std::span<const PointCorrespondence> matches,
                       double pixel_sigma_px, const Rigid3& cam_from_world);

}  // namespace plumb
