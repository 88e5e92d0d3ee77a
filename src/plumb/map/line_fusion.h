// Fuses the lifted segments of all key frames into lines.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "plumb/map/depth_view.h"
#include "plumb/map/line_association.h"
#include "plumb/map/line_fit.h"
#include "plumb/map/line_map.h"
#include "plumb/map/pnp_filter.h"

namespace plumb {

struct LineFusionOptions {
  AssociationGate grow{0.06, 4.0, 0.3, 0.005};    // frame by frame, on unrefined lines
  AssociationGate settle{0.05, 2.5, 0.4, 0.004};  // all frames, on refined lines
  LineFitOptions fit;
  DepthNoise depth_noise;
  uint32_t min_key_frames = 1;  // that must have observed a line
};

/// Lines of all key frames, longest tracks first. Sets `line` of every lifted segment (nullopt when
/// the PnP filter rejected it or its line has too few key frames) and of each line everything but
/// num_expected, which is num_observing. Deterministic.
///
/// @param key_frames     Their segments are the observations; several of a frame may join one line.
/// @param progress       Called with 0..1, may be empty.
/// @param out_rejected   Number of segments that the filter rejected; may be null.
/// Source: docs/method/association.md.
std::vector<MapLine> FuseLines(const LineFusionOptions& options, const PnpFilterOptions& filter,
                               std::vector<KeyFrame>* key_frames,
                               const std::function<void(double)>& progress, size_t* out_rejected);

}  // namespace plumb
