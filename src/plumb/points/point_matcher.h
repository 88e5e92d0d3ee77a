// 2D-3D matches between an image's points and the map's.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "plumb/geometry/rigid3.h"
#include "plumb/map/depth_view.h"
#include "plumb/map/map_index.h"
#include "plumb/points/descriptor_matcher.h"
#include "plumb/points/point_features.h"

namespace plumb {

struct PointMatcherOptions {
  uint32_t num_key_frames = 10;  // nearest to a prior
  double max_ratio = 0.8;        // of the distances to the nearest and second nearest descriptor
  DepthNoise depth_noise;
  /// On the depth deviation: the depth errors of a key frame's points are common to many of them.
  double deviation_factor = 3.0;
};

/// An image point and the map point that it shows.
struct PointCorrespondence {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  /// Standard deviation of the point along the ray of the key frame that made it [m].
  Eigen::Vector3d deviation_in_world = Eigen::Vector3d::Zero();
  uint32_t key_frame = 0;    // LineMap::key_frames[key_frame] ...
  uint32_t map_point = 0;    // ... .points[map_point]
  uint32_t image_point = 0;  // index into the ImagePoints
};

/// Owns the work space; not thread-safe.
class PointMatcher {
 public:
  explicit PointMatcher(const PointMatcherOptions& options = {}) : options_(options) {}

  /// Matches against each of the key frames nearest to one of the priors on its own (ratio and
  /// mutual), so that an image point may appear once for each. All matches are returned: whoever
  /// has a better pose than the prior drops those that do not fit it. Ordered by prior, then by key
  /// frame, nearest first, then by image point; no key frame twice.
  void Match(const ImagePoints& points, const MapIndex& index,
             std::span<const Rigid3> priors_cam_from_world,
             std::vector<PointCorrespondence>* out_matches);

 private:
  PointMatcherOptions options_;
  DescriptorMatcher matcher_;
  DescriptorTable image_table_, map_table_;
  std::vector<uint32_t> key_frames_, nearest_;
  std::vector<DescriptorPair> pairs_;
};

/// Standard deviation, along the key frame's ray, of a point lifted there: factor * noise(z) * the
/// ray with z = 1, in the world [m]. Zero for a point that is not in front of the key frame.
Eigen::Vector3d DeviationAlongRay(const Rigid3& cam_from_world,
                                  const Eigen::Vector3d& point_in_world, const DepthNoise& noise,
                                  double factor);

}  // namespace plumb
