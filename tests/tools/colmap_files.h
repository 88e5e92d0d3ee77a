// Files of COLMAP models as COLMAP writes them.
#pragma once

#include <cstdint>
#include <cstring>
#include <iomanip>
#include <sstream>
#include <string>
#include <vector>

#include "plumb/geometry/rigid3.h"

namespace plumb::testing {

struct ColmapFileCamera {
  uint32_t id;
  int32_t model_id;
  std::string model;
  uint64_t width, height;
  std::vector<double> parameters;
};

struct ColmapFileImage {
  uint32_t id;
  Rigid3 cam_from_world;
  uint32_t camera_id;
  std::string name;
  int num_observations = 0;
};

struct ColmapFiles {
  std::string cameras, images;
};

inline ColmapFiles AsColmapText(const std::vector<ColmapFileCamera>& cameras,
                                const std::vector<ColmapFileImage>& images) {
  std::ostringstream c, i;
  c << std::setprecision(17) << "# Camera list with one line of data per camera:\n"
    << "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: " << cameras.size()
    << "\n";
  for (const ColmapFileCamera& camera : cameras) {
    c << camera.id << " " << camera.model << " " << camera.width << " " << camera.height;
    for (const double value : camera.parameters) c << " " << value;
    c << "\n";
  }
  i << std::setprecision(17) << "# Image list with two lines of data per image:\n";
  for (const ColmapFileImage& image : images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    const Eigen::Vector3d& t = image.cam_from_world.translation;
    i << image.id << " " << q.w() << " " << q.x() << " " << q.y() << " " << q.z() << " " << t.x()
      << " " << t.y() << " " << t.z() << " " << image.camera_id << " " << image.name << "\n";
    for (int k = 0; k < image.num_observations; ++k) {
      i << (k > 0 ? " " : "") << 10.5 * k << " " << 7.25 << " " << (k % 2 == 0 ? -1 : k);
    }
    i << "\n";
  }
  return {c.str(), i.str()};
}

inline ColmapFiles AsColmapBinary(const std::vector<ColmapFileCamera>& cameras,
                                  const std::vector<ColmapFileImage>& images) {
  ColmapFiles files;
  const auto put = [](std::string* to, const auto& value) {
    to->append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  put(&files.cameras, uint64_t{cameras.size()});
  for (const ColmapFileCamera& camera : cameras) {
    put(&files.cameras, camera.id);
    put(&files.cameras, camera.model_id);
    put(&files.cameras, camera.width);
    put(&files.cameras, camera.height);
    for (const double value : camera.parameters) put(&files.cameras, value);
  }
  put(&files.images, uint64_t{images.size()});
  for (const ColmapFileImage& image : images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    put(&files.images, image.id);
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) put(&files.images, value);
    for (const double value : image.cam_from_world.translation) put(&files.images, value);
    put(&files.images, image.camera_id);
    files.images.append(image.name.c_str(), image.name.size() + 1);
    put(&files.images, static_cast<uint64_t>(image.num_observations));
    for (int k = 0; k < image.num_observations; ++k) {
      put(&files.images, 10.5 * k);
      put(&files.images, 7.25);
      put(&files.images, static_cast<int64_t>(k % 2 == 0 ? -1 : k));
    }
  }
  return files;
}

}  // namespace plumb::testing
