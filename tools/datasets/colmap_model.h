// Cameras and posed images of a COLMAP model, in its text or its binary form.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "plumb/base/result.h"
#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/rigid3.h"

namespace plumb::tools {

struct ColmapCamera {
  uint32_t id = 0;
  ImageCamera camera;  // pixels as here: COLMAP's are half a pixel more
};

struct ColmapImage {
  uint32_t id = 0;
  std::string name;  // path inside the folder of images
  Rigid3 cam_from_world;
  size_t camera = 0;  // index into the model's cameras
};

struct ColmapModel {
  std::vector<ColmapCamera> cameras;  // those that an image uses, by ascending id
  std::vector<ColmapImage> images;    // by ascending name
};

/// Reads cameras.bin and images.bin, or without them cameras.txt and images.txt. Points are not
/// looked at. SIMPLE_PINHOLE and PINHOLE have no lens; SIMPLE_RADIAL, RADIAL, OPENCV and
/// FULL_OPENCV become RADTAN, OPENCV_FISHEYE becomes KANNALA_BRANDT.
/// @return kNotFound without a model in `directory`; kUnsupported naming camera and model for other
///         models, of cameras that an image uses; kCorruptData naming the file and its line or the
///         number of the record for everything else.
/// Source: COLMAP's documentation, "Output Format".
Result<ColmapModel> ReadColmapModel(const std::string& directory);

/// The two forms of ReadColmapModel(), from the files' contents.
/// @param cameras_path, images_path  For messages.
Result<ColmapModel> ParseColmapText(std::string_view cameras, std::string_view images,
                                    const std::string& cameras_path,
                                    const std::string& images_path);
Result<ColmapModel> ParseColmapBinary(std::string_view cameras, std::string_view images,
                                      const std::string& cameras_path,
                                      const std::string& images_path);

}  // namespace plumb::tools
