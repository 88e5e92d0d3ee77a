// From where a map's lines were seen, and how often they should have been.
#pragma once

#include "plumb/map/line_map.h"

namespace plumb {

/// Fills sightings, sighting_begin and num_expected from the key frames' segments, whose `line`
/// must be valid ids. A line has one sighting for each key frame that observed it, ascending; it is
/// expected in every key frame in which it projects more than 15 px inside the image, and in those
/// that observed it. Occlusion is not looked at: a line's stability is num_observing over
/// num_expected.
/// Source: docs/method/association.md.
void ComputeVisibility(LineMap* map);

}  // namespace plumb
