// Furnished rooms, one for every seed.
#pragma once

#include <cstdint>

#include "tools/synth/scene.h"

namespace plumb::synth {

/// A room of 4 to 6 m by 3.6 to 5 m with doors, windows, pictures, skirting boards, tables,
/// chairs, shelves with books, cupboards, steps and clutter along its walls, all drawn from `seed`.
/// The middle stays free for the camera.
Scene MakeRoom(uint64_t seed);

}  // namespace plumb::synth
