// Straight edges of the ideal image as the curves that a lens makes of them, in chords.
#pragma once

#include <vector>

#include "plumb/geometry/rectifier.h"
#include "plumb/geometry/segment.h"

namespace plumb::synth {

/// Furthest that a chord may be from its curve [px].
inline constexpr double kChordTolerancePx = 0.5;

/// The parts of `segment` [px of the ideal image] that lie inside the taken image (to 1/128 of its
/// length), as chords [px of the taken image] longer than `min_length_px`. Without a lens the
/// segment itself.
std::vector<Segment2> ChordsInImage(const Rectifier& rectifier, const Segment2& segment,
                                    double min_length_px);

}  // namespace plumb::synth
