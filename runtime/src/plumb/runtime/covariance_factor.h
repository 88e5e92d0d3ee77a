// By how much the errors of map and key-frame poses enlarge the covariance of a pose.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "plumb/geometry/rigid3.h"
#include "plumb/map/map_index.h"

namespace plumb {

/// Key frames whose own lines decide a refined pose.
inline constexpr uint32_t kLocalKeyFrames = 3;

/// Mean distance of a pose to key frames, centre distance [m] + angle between the rotations [rad].
double MeanDistance(const LineMap& map, std::span<const uint32_t> key_frames,
                    const Rigid3& cam_from_world);

/// LineMap::covariance_factor and covariance_growth at a pose: errors of the map are common to all
/// lines of a frame and show the more the farther it is from the key frames that made them.
/// Constant beyond kMaxFactorDistance.
double CovarianceFactor(const LineMap& map, double distance);
inline constexpr double kMaxFactorDistance = 0.8;

/// The same at `cam_from_world`. `scratch` keeps its memory.
double CovarianceFactorAt(const MapIndex& index, const Rigid3& cam_from_world,
                          std::vector<uint32_t>* scratch);

}  // namespace plumb
