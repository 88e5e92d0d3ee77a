// Writes what the programs of these tests read: a map, images and their poses.
//
// usage: write_fixture DIR    makes DIR/map, DIR/<i>.pgm and DIR/poses.txt with a line a frame:
//        fx fy cx cy, prior (q_xyzw t), truth (q_xyzw t); DIR/radtan.pgm and DIR/fisheye.pgm are
//        frame 0 through the lenses of frame_test.c
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "plumb/map/map_file.h"
#include "support/wall_scene.h"

namespace plumb {
namespace {

constexpr int kNumFrames = 4;

Rigid3 TruePose(int i) {
  const Eigen::Vector3d centre(0.02 * i - 0.05, 0.01 * i, 0.03);
  const Eigen::Quaterniond rotation = ExpSo3({0.01, 0.2 + 0.01 * i, -0.01});
  return {rotation, -(rotation * centre)};
}

void Print(const Rigid3& pose, std::ostream& out) {
  out << ' ' << pose.rotation.coeffs().transpose() << ' ' << pose.translation.transpose();
}

void WriteImage(const testing::GrayImage& image, const std::filesystem::path& path) {
  std::ofstream file(path, std::ios::binary);
  file << "P5 " << image.width_px << ' ' << image.height_px << " 255\n";
  file.write(reinterpret_cast<const char*>(image.pixels.data()),
             static_cast<std::streamsize>(image.pixels.size()));
}

int Main(const std::filesystem::path& directory) {
  std::filesystem::remove_all(directory);
  std::filesystem::create_directories(directory);
  const testing::WallScene scene;
  const Status written =
      WriteMap(scene.MakeMap(testing::WallScene::KeyFramePoses()), (directory / "map").string());
  if (!written) {
    std::fprintf(stderr, "%s\n", written.error().message.c_str());
    return 1;
  }
  const std::pair<const char*, Lens> lenses[] = {
      {"radtan.pgm", {LensModel::kRadTan, {-0.3, 0.1, 0.001, -0.002}}},
      {"fisheye.pgm", {LensModel::kKannalaBrandt, {-0.02, 0.005, 0.0, 0.0}}}};
  for (const auto& [name, lens] : lenses)
    WriteImage(scene.Render(TruePose(0), lens), directory / name);
  std::ofstream poses(directory / "poses.txt");
  poses.precision(12);
  for (int i = 0; i < kNumFrames; ++i) {
    WriteImage(scene.Render(TruePose(i)), directory / (std::to_string(i) + ".pgm"));
    Vector6d error;
    error << 0.015, -0.012, 0.008, 0.025, -0.02, 0.024;
    poses << scene.camera.fx << ' ' << scene.camera.fy << ' ' << scene.camera.cx << ' '
          << scene.camera.cy;
    Print(Perturb(TruePose(i), error), poses);
    Print(TruePose(i), poses);
    poses << '\n';
  }
  return poses ? 0 : 1;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) { return argc == 2 ? plumb::Main(argv[1]) : 2; }
