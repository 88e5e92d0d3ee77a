// Applies the PnP-RANSAC filter to all tracks.
#pragma once

#include <cstddef>
#include <vector>

#include "plumb/map/line_fit.h"
#include "plumb/map/line_tracks.h"
#include "plumb/map/observation_table.h"
#include "plumb/map/pnp_filter.h"

namespace plumb {

/// Removes observations that PnpInliers() rejects in their key frame. The place of an end point is
/// where the line, fitted to its other key frames only, comes nearest to the end point's ray; lines
/// of one key frame cannot be tested and stay. Tracks may be left without observations.
/// @return ids of the removed observations, ascending.
std::vector<uint32_t> FilterTracks(const ObservationTable& table, const LineFitOptions& fit,
                                   const PnpFilterOptions& options, std::vector<LineTrack>* tracks);

}  // namespace plumb
