// SIFT points of recorded images, for maps and for queries (--points opencv).
#pragma once

#include <span>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/depth_view.h"
#include "plumb/map/map_index.h"
#include "plumb/points/point_features.h"
#include "plumb/points/point_matcher.h"
#include "plumb/runtime/pose_refiner.h"

namespace plumb::tools {

/// Owns the work space of extraction and matching. Not thread-safe.
class PointFrontEnd {
 public:
  /// Points of a key frame that have depth.
  /// @param image  8-bit BGR.
  Result<std::vector<MapPoint>> KeyFramePoints(const cv::Mat& image, const Rectifier& rectifier,
                                               const Rigid3& cam_from_world,
                                               const DepthView& depth);

  /// Finds the points of a query image, for any number of MatchQuery().
  Status ExtractQuery(const cv::Mat& image, const Rectifier& rectifier);

  /// 2D-3D matches of the query image with the key frames near its priors: all of them for the
  /// search, which drops those that do not fit the lines' pose, else the inliers of PnP-RANSAC.
  /// Pixels are those of the image.
  std::vector<PointMatch> MatchQuery(const Camera& ideal, const MapIndex& index,
                                     std::span<const Rigid3> priors_cam_from_world,
                                     RefineMethod method);

 private:
  Status Extract(const cv::Mat& image);

  PointExtractor extractor_;
  PointMatcher matcher_;
  cv::Mat gray_;
  ImagePoints points_;
  std::vector<Eigen::Vector2f> image_pixels_;  // of points_, before they moved to the ideal image
  std::vector<PointCorrespondence> correspondences_;
};

}  // namespace plumb::tools
