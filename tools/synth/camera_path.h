// A hand-held walk through a room.
#pragma once

#include <cstdint>
#include <vector>

#include "plumb/geometry/rigid3.h"
#include "tools/synth/random.h"
#include "tools/synth/scene.h"

namespace plumb::synth {

/// `count` poses (cam_from_world) along a smooth loop in the scene's free space; the camera looks
/// outwards across the room, turns by `sweep_rad` in all and sways as a hand does.
std::vector<Rigid3> MakeCameraPath(const Scene& scene, int count, double sweep_rad, uint64_t seed);

/// cam_from_world moved by exactly `position_m` and turned by exactly `rotation_rad`, in random
/// directions: the camera centre moves, then the camera turns about it.
Rigid3 Displace(const Rigid3& cam_from_world, double position_m, double rotation_rad,
                Random* random);

/// What a tracker that is never corrected would report: the true motion with a random walk on top,
/// a step of `position_step_m` and `rotation_step_rad` (norms) a frame. Starts at the truth.
std::vector<Rigid3> DriftingTrack(const std::vector<Rigid3>& truth, double position_step_m,
                                  double rotation_step_rad, Random* random);

}  // namespace plumb::synth
