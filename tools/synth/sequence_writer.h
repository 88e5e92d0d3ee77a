// A rendered room on disk: a posed RGB-D sequence with exact truth and priors that are off.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "plumb/base/result.h"
#include "plumb/geometry/lens.h"

namespace plumb::synth {

struct SequenceOptions {
  uint64_t seed = 1;
  int num_frames = 60;       // 2..100000
  int map_every = 3;         // every so many frames is a map frame, the others are queries; >= 2
  int width_px = 640;        // 64..4096
  int height_px = 480;       // 64..4096
  double focal_px = 525.0;   // > 0
  Lens lens;                 // of the camera; the principal point is the image's middle
  double sweep_deg = 120.0;  // turn of the camera over the sequence, 0..3600
  double depth_noise =
      0.0;  // standard deviation [m] at 1 m, grows with the square of the depth; >= 0
  double image_noise = 1.5;  // standard deviation [grey levels]; >= 0
  int samples_per_axis = 3;  // rays a pixel = square of this, 1..8
  bool shadows = true;
  bool png = false;  // colour images as PNG (exact) instead of JPEG

  Status Validate() const;
};

/// Writes into the existing directory `directory`, in the layout of TUM RGB-D:
///
///   rgb/ depth/ rgb.txt depth.txt camera.json groundtruth.txt   depth in millimetres
///   splits/map.txt query.txt prior_p02.txt .. prior_p40.txt prior_drift.txt
///   lines3d.txt        exact 3D edges that some frame sees: x1 y1 z1 x2 y2 z2 [m]
///   annotations.json   their visible parts in every image, for `eval lines` (with images = rgb/);
///                      with a lens, chords that are within 0.5 px of their curves
///
/// prior_pXX: the truth moved by exactly XX cm and 0.5, 1, 2, 4 or 8 deg; prior_drift: a tracker
/// that is never corrected.
/// @param progress  Called with (frames done, frames in all); an error of it ends the work and is
///                  returned; may be empty.
/// @return kInvalidArgument naming a bad option; kInternal naming a file that cannot be written.
Status WriteSequence(const SequenceOptions& options, const std::string& directory,
                     const std::function<Status(int, int)>& progress);

/// Whether WriteSequence() may write `name`, relative to its directory; folders end in a slash.
bool IsSequenceFile(std::string_view name);

}  // namespace plumb::synth
