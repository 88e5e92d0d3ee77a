// A room that renders in seconds, for tests that run the whole program on it.
#pragma once

#include "tools/synth/sequence_writer.h"

namespace plumb::testing {

inline synth::SequenceOptions SmallRoom(int num_frames, double sweep_deg) {
  synth::SequenceOptions options;
  options.seed = 2;
  options.num_frames = num_frames;
  options.sweep_deg = sweep_deg;
  options.width_px = 320;
  options.height_px = 240;
  options.focal_px = 262.5;
  options.samples_per_axis = 2;
  return options;
}

}  // namespace plumb::testing
