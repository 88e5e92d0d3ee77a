// camera.json: intrinsics, lens and depth scale of a sequence.
#pragma once

#include <string>

#include "plumb/base/result.h"
#include "plumb/geometry/rectifier.h"

namespace plumb::tools {

struct CameraFile {
  ImageCamera camera;
  double depth_scale = 0.0;  // depth image units per metre; 0: not given
};

/// Parses {"model", "width", "height", "fx", "fy", "cx", "cy", "distortion_coefficients",
/// "depth_scale"}. "model" is one of
/// - "PINHOLE" (or absent): no coefficients, or all of them 0;
/// - "RADTAN": 4, 5 or 8 coefficients, k1 k2 p1 p2 [k3 [k4 k5 k6]]; COLMAP's "OPENCV" (4) and
///   "FULL_OPENCV" (8) are the same;
/// - "KANNALA_BRANDT": k1 k2 k3 k4; COLMAP's "OPENCV_FISHEYE" is the same.
/// The image, its depth and the principal point are those of the taken, distorted image.
/// @param path  for messages
/// @param needs_depth_scale  "depth_scale" must be there
/// @return kCorruptData naming file, member and value; kUnsupported for another model.
Result<CameraFile> ParseCameraFile(const std::string& text, const std::string& path,
                                   bool needs_depth_scale);

/// The text of camera.json. @param source  where the camera is from, for people.
std::string FormatCameraFile(const CameraFile& file, const std::string& source);

}  // namespace plumb::tools
