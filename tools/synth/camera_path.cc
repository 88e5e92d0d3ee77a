#include "tools/synth/camera_path.h"

#include <cmath>
#include <numbers>

namespace plumb::synth {
namespace {

Eigen::Vector3d UnitVector(Random* random) {
  return Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal()).normalized();
}

/// Camera at `centre` that looks along azimuth and elevation (world z up), rolled about its axis.
Rigid3 LookAlong(const Eigen::Vector3d& centre, double azimuth, double elevation, double roll) {
  const Eigen::Vector3d forward(std::cos(elevation) * std::cos(azimuth),
                                std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d world_from_cam;  // columns: x right, y down, z forward
  world_from_cam << right, forward.cross(right), forward;
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(world_from_cam) * ExpSo3(roll * Eigen::Vector3d::UnitZ());
  return Rigid3{turn.normalized(), centre}.Inverse();
}

}  // namespace

std::vector<Rigid3> MakeCameraPath(const Scene& scene, int count, double sweep_rad, uint64_t seed) {
  Random random(Random::Mix(seed + 77));
  const Eigen::Vector3d middle = scene.free_space.center();
  const Eigen::Vector3d reach = 0.5 * scene.free_space.sizes();
  const double start = random.Uniform(0.0, 2.0 * std::numbers::pi);
  double phase[4];
  for (double& p : phase) p = random.Uniform(0.0, 2.0 * std::numbers::pi);
  std::vector<Rigid3> poses;
  for (int i = 0; i < count; ++i) {
    const double u = count > 1 ? static_cast<double>(i) / (count - 1) : 0.0;
    const double along = start + sweep_rad * u;
    // Standing on one side and looking across the middle keeps two to five metres ahead.
    const Eigen::Vector3d centre =
        middle + Eigen::Vector3d(-0.9 * reach.x() * std::cos(along),
                                 -0.9 * reach.y() * std::sin(along),
                                 0.7 * reach.z() * std::sin(2.0 * along + phase[0]));
    const double azimuth = along + 0.25 * std::sin(2.7 * along + phase[1]);
    const double elevation = -0.15 + 0.12 * std::sin(1.9 * along + phase[2]);
    const double roll = 0.04 * std::sin(3.1 * along + phase[3]);
    poses.push_back(LookAlong(centre, azimuth, elevation, roll));
  }
  return poses;
}

Rigid3 Displace(const Rigid3& cam_from_world, double position_m, double rotation_rad,
                Random* random) {
  Rigid3 world_from_cam = cam_from_world.Inverse();
  world_from_cam.translation += position_m * UnitVector(random);
  world_from_cam.rotation =
      (world_from_cam.rotation * ExpSo3(rotation_rad * UnitVector(random))).normalized();
  return world_from_cam.Inverse();
}

std::vector<Rigid3> DriftingTrack(const std::vector<Rigid3>& truth, double position_step_m,
                                  double rotation_step_rad, Random* random) {
  std::vector<Rigid3> track;
  Rigid3 drift;  // drifted camera from true camera
  for (const Rigid3& cam_from_world : truth) {
    track.push_back(drift * cam_from_world);
    drift = Rigid3{ExpSo3(rotation_step_rad * UnitVector(random)),
                   position_step_m * UnitVector(random)} *
            drift;
  }
  return track;
}

}  // namespace plumb::synth
