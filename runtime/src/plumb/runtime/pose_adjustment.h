// Adjusts the poses of a map's key frames together with its lines.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/geometry/rigid3.h"
#include "plumb/map/line_map.h"
#include "plumb/map/map_builder.h"
#include "plumb/refine/bundle.h"

namespace plumb {

struct MapPoses {
  std::vector<Rigid3> cam_from_world;  // of the key frames
  /// Median distance of a segment's ends from the line that it supports, lines of two key frames
  /// or more: at the poses and lines of the map, and after the adjustment.
  double before_px = 0.0, after_px = 0.0;
};

/// Adjusts the key frames' poses so that their segments, and the depth behind them, agree on the
/// lines. Lines of one key frame say nothing and are left out; a key frame without others stays at
/// its prior.
///
/// @param priors  Poses as they were given, one a key frame. The adjustment starts at the map's
///                own, which may come from a round before.
/// @return nullopt when the map has no line of two key frames, and when priors or options are out
///         of range (BundleOptions).
/// Source: docs/adr/0013-adjusting-key-frame-poses.md.
std::optional<MapPoses> AdjustMapPoses(const LineMap& map, std::span<const Rigid3> priors,
                                       const BundleOptions& options = {});

struct AdjustedMap {
  LineMap map;  // with `pose_change`
  /// MapPoses::before_px of the first round, after_px of the last; 0 when nothing could be
  /// adjusted.
  double before_px = 0.0, after_px = 0.0;
};

/// Adjusts the key frames of `builder` and fuses their lines again, several times: at better poses
/// more segments find their lines. The first rounds trust segments less, so that poses which are
/// off by pixels are drawn by lines that do not fit yet. The poses that the builder has are the
/// priors, and afterwards it has the adjusted ones.
/// @return an error of MapBuilder::Build(). A map that AdjustMapPoses() refuses comes as it is,
///         without `pose_change`.
Result<AdjustedMap> BuildAdjustedMap(MapBuilder* builder, const BundleOptions& options,
                                     const MapBuildProgress& progress = {});

/// Medians over the key frames of how far `poses` are from `priors`.
PoseChange MedianChange(std::span<const Rigid3> priors, std::span<const Rigid3> poses);

}  // namespace plumb
