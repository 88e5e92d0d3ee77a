// SIFT points of recorded images, for maps and for queries (--points opencv).
#include "tools/plumbline/point_front_end.h"

#include <cstddef>
#include <cstdint>
#include <optional>

#include <opencv2/imgproc.hpp>

#include "plumb/points/point_lifting.h"
#include "plumb/points/point_pose.h"

namespace plumb::tools {
namespace {

/// Moves points into the ideal image; those that have no place there go, from both lists.
void RectifyPixels(const Rectifier& rectifier, ImagePoints* points,
                   std::vector<Eigen::Vector2f>* image_pixels) {
  size_t count = 0;
  for (size_t i = 0; i < points->size(); ++i) {
    const auto ideal = rectifier.ToIdeal(points->pixels[i].cast<double>());
    if (!ideal) continue;
    points->pixels[count] = ideal->cast<float>();
    (*image_pixels)[count] = (*image_pixels)[i];
    points->descriptors[count++] = points->descriptors[i];
  }
  points->pixels.resize(count);
  points->descriptors.resize(count);
  image_pixels->resize(count);
}

}  // namespace

Status PointFrontEnd::Extract(const cv::Mat& image) {
  cv::cvtColor(image, gray_, cv::COLOR_BGR2GRAY);
  return extractor_.Extract(
      {gray_.data, static_cast<int64_t>(gray_.step[0]), gray_.cols, gray_.rows}, &points_);
}

Result<std::vector<MapPoint>> PointFrontEnd::KeyFramePoints(const cv::Mat& image,
                                                            const Rectifier& rectifier,
                                                            const Rigid3& cam_from_world,
                                                            const DepthView& depth) {
  if (const Status extracted = Extract(image); !extracted) return extracted.error();
  return LiftPoints(points_, rectifier, cam_from_world, depth);
}

Status PointFrontEnd::ExtractQuery(const cv::Mat& image, const Rectifier& rectifier) {
  if (const Status extracted = Extract(image); !extracted) return extracted;
  image_pixels_ = points_.pixels;
  if (!rectifier.IsIdentity()) RectifyPixels(rectifier, &points_, &image_pixels_);
  return Ok();
}

std::vector<PointMatch> PointFrontEnd::MatchQuery(const Camera& ideal, const MapIndex& index,
                                                  std::span<const Rigid3> priors_cam_from_world,
                                                  RefineMethod method) {
  matcher_.Match(points_, index, priors_cam_from_world, &correspondences_);
  std::vector<PointMatch> matches;
  const auto add = [&](const PointCorrespondence& c) {
    matches.push_back(
        {image_pixels_[c.image_point].cast<double>(), c.point_in_world, c.deviation_in_world});
  };
  if (method == RefineMethod::kSearch) {
    for (const PointCorrespondence& c : correspondences_) add(c);
  } else if (const std::optional<PointPose> pose = EstimatePointPose(ideal, correspondences_)) {
    for (const uint32_t inlier : pose->inliers) add(correspondences_[inlier]);
  }
  return matches;
}

}  // namespace plumb::tools
