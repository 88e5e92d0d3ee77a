#include "plumb/runtime/covariance_factor.h"

#include <algorithm>

namespace plumb {

double MeanDistance(const LineMap& map, std::span<const uint32_t> key_frames,
                    const Rigid3& cam_from_world) {
  double sum = 0.0;
  for (const uint32_t k : key_frames) {
    const PoseDistance distance = DistanceBetween(map.key_frames[k].cam_from_world, cam_from_world);
    sum += distance.position_m + distance.rotation_rad;
  }
  return key_frames.empty() ? 0.0 : sum / static_cast<double>(key_frames.size());
}

double CovarianceFactor(const LineMap& map, double distance) {
  return map.covariance_factor + map.covariance_growth * std::min(distance, kMaxFactorDistance);
}

double CovarianceFactorAt(const MapIndex& index, const Rigid3& cam_from_world,
                          std::vector<uint32_t>* scratch) {
  index.NearestKeyFrames(cam_from_world, kLocalKeyFrames, scratch);
  return CovarianceFactor(index.map(), MeanDistance(index.map(), *scratch, cam_from_world));
}

}  // namespace plumb
