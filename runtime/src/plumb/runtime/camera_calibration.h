// Finds what is wrong with the intrinsics of the camera that a map's key frames were taken with.
#pragma once

#include <optional>

#include "plumb/geometry/camera_correction.h"
#include "plumb/map/line_map.h"

namespace plumb {

/// Focal length, principal point and radial distortion with which the lines of a map agree best
/// over its views (AdjustCamera()), poses as they are. Wrong ones turn a pose by a share of the
/// angle to the key frames that see the same lines.
///
/// It is kept only if, fitted to the first or the second half of the key frames, it makes the lines
/// of the other half agree better than chance would, both ways, moves some part of the image by a
/// tenth of a pixel and loses none.
/// @param map        Key frames of one camera; lines should come from depth images, not from views
///                   that already agree.
/// @param rectifier  Of that camera: the key frames' segments are in its ideal image.
/// @return nullopt when there is nothing to correct, or too little to find it from.
/// Source: docs/adr/0017-views-correct-the-camera.md.
std::optional<CameraCorrection> CalibrateCamera(const LineMap& map, const Rectifier& rectifier);

/// Largest distance [px] between where the two cameras image the same ray, over the image.
double LargestShiftPx(const CameraCorrection& correction);

}  // namespace plumb
