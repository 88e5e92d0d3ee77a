// SIFT points of recorded images, for maps and for queries (--points opencv).
#include "tools/plumbline/point_front_end.h"

#include <cstdint>
#include <optional>

#include <opencv2/imgproc.hpp>

#include "plumb/points/point_lifting.h"
#include "plumb/points/point_pose.h"

namespace plumb::tools {

Status PointFrontEnd::Extract(const cv::Mat& image) {
  cv::cvtColor(image, gray_, cv::COLOR_BGR2GRAY);
  return extractor_.Extract(
      {gray_.data, static_cast<int64_t>(gray_.step[0]), gray_.cols, gray_.rows}, &points_);
}

Result<std::vector<MapPoint>> PointFrontEnd::KeyFramePoints(const cv::Mat& image,
                                                            const Camera& camera,
                                                            const Rigid3& cam_from_world,
                                                            const DepthView& depth) {
  if (const Status extracted = Extract(image); !extracted) return extracted.error();
  return LiftPoints(points_, camera, cam_from_world, depth);
}

Result<std::vector<PointMatch>> PointFrontEnd::QueryMatches(const cv::Mat& image,
                                                            const Camera& camera,
                                                            const MapIndex& index,
                                                            const Rigid3& prior_cam_from_world,
                                                            RefineMethod method) {
  if (const Status extracted = Extract(image); !extracted) return extracted.error();
  matcher_.Match(points_, index, prior_cam_from_world, &correspondences_);
  std::vector<PointMatch> matches;
  const auto add = [&](const PointCorrespondence& c) {
    matches.push_back({c.pixel, c.point_in_world, c.deviation_in_world});
  };
  if (method == RefineMethod::kSearch) {
    for (const PointCorrespondence& c : correspondences_) add(c);
  } else if (const std::optional<PointPose> pose = EstimatePointPose(camera, correspondences_)) {
    for (const uint32_t inlier : pose->inliers) add(correspondences_[inlier]);
  }
  return matches;
}

}  // namespace plumb::tools
