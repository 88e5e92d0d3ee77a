// Tracks: a 3D line and the segments of all key frames that belong to it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "plumb/map/line_association.h"
#include "plumb/map/line_fit.h"
#include "plumb/map/observation_table.h"

namespace plumb {

struct LineTrack {
  Segment3 segment_in_world;
  std::vector<uint32_t> observations;  // ids of the table, grouped by ascending frame
};

using TrackProgress = std::function<void(double done)>;  // 0..1

/// Goes through the frames once: a segment joins the line that it lies nearest to in the image, or
/// starts a line, longest first. A segment joins one line; several of a frame may join the same.
std::vector<LineTrack> GrowTracks(const ObservationTable& table, const AssociationGate& gate,
                                  const TrackProgress& progress);

/// Associates every segment anew with refined lines. The nearest line in the image wins, but a line
/// of twice as many observations may lie 1 px farther away, so that near-duplicates merge. Tracks
/// come back by descending number of observations before; those that lost all segments are gone.
std::vector<LineTrack> SettleTracks(const ObservationTable& table, const AssociationGate& gate,
                                    std::vector<LineTrack> tracks, const TrackProgress& progress);

/// Fits the track's line to its observations and cuts it to the extent that they support.
/// @return the fit, whose anchors are the track's new end points; nullopt (and the track as it was)
///         when the line degenerates.
std::optional<FittedLine> RefineTrack(const ObservationTable& table, const LineFitOptions& options,
                                      LineTrack* track);

}  // namespace plumb
