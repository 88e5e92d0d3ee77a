// Lower scores for lines that repeat a better one.
#pragma once

#include <vector>

#include "plumb/features/vlse_decode_reference.h"

namespace plumb {

/// A network often finds one line from several neighbouring cells. Which of them is right is not
/// certain, so that dropping all but the best loses lines; ranking them lower loses none.
struct DuplicateDecay {
  float distance_cells2 = 2.0f;  // sum of the squared distances of the two pairs of end points
  float decay = 1.0f;            // 0..1, on the score for every better line that near; 1: off
};

/// @param lines           best score first, and so again afterwards; equal scores keep their order.
/// @param score_threshold lines that fall below it go.
/// @param cells_per_px_x, cells_per_px_y  of the network's output per pixel of the image.
void DecayDuplicates(const DuplicateDecay& options, float cells_per_px_x, float cells_per_px_y,
                     float score_threshold, std::vector<DecodedLine>* lines);

}  // namespace plumb
