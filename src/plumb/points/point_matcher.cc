#include "plumb/points/point_matcher.h"

#include <algorithm>

namespace plumb {
namespace {

constexpr size_t kMinPoints = 5;  // below, the ratio test says nothing

}  // namespace

void PointMatcher::Match(const ImagePoints& points, const MapIndex& index,
                         std::span<const Rigid3> priors_cam_from_world,
                         std::vector<PointCorrespondence>* out_matches) {
  out_matches->clear();
  if (points.size() < kMinPoints) return;
  image_table_.Clear();
  for (const PointDescriptor& descriptor : points.descriptors) image_table_.Add(descriptor);
  key_frames_.clear();
  for (const Rigid3& prior : priors_cam_from_world) {
    index.NearestKeyFrames(prior, options_.num_key_frames, &nearest_);
    for (const uint32_t k : nearest_) {
      if (std::find(key_frames_.begin(), key_frames_.end(), k) == key_frames_.end()) {
        key_frames_.push_back(k);
      }
    }
  }
  for (const uint32_t k : key_frames_) {
    const KeyFrame& key_frame = index.map().key_frames[k];
    if (key_frame.points.size() < kMinPoints) continue;
    map_table_.Clear();
    for (const MapPoint& point : key_frame.points) map_table_.Add(point.descriptor);
    matcher_.Match(image_table_, map_table_, options_.max_ratio, &pairs_);
    for (const DescriptorPair& pair : pairs_) {
      const Eigen::Vector3d point = key_frame.points[pair.b].point_in_world.cast<double>();
      out_matches->push_back({points.pixels[pair.a].cast<double>(), point,
                              DeviationAlongRay(key_frame.cam_from_world, point,
                                                options_.depth_noise, options_.deviation_factor),
                              k, pair.b, pair.a});
    }
  }
}

Eigen::Vector3d DeviationAlongRay(const Rigid3& cam_from_world,
                                  const Eigen::Vector3d& point_in_world, const DepthNoise& noise,
                                  double factor) {
  const Eigen::Vector3d point = cam_from_world * point_in_world;
  if (!(point.z() > 0.0)) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d ray = point / point.z();
  return cam_from_world.rotation.conjugate() * (factor * noise.SigmaAt(point.z()) * ray);
}

}  // namespace plumb
