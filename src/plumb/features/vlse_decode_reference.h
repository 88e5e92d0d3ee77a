// From the network's output planes to lines on the CPU, in plain loops: defines VlseDecoder.
#pragma once

#include <span>
#include <vector>

#include "shaders/decode/decode_params.h"

namespace plumb {

using DecodedLine = shaders::DecodedLine;

struct DecodeOptions {
  int width_cells = 0, height_cells = 0;  // of the output planes; width a multiple of 4
  int max_lines = 300;                    // 1..4096, best scores first
  float score_threshold = 0.1f;           // 0..1
  float nms_decay = 0.8f;                 // 0..1, on the score of cells that are no 3 x 3 maximum
  float displacement_scale = 1.0f;        // cells per unit of planes 4 and 5
};

/// Lines of the output planes [6][height][width]: midpoint logits 2, offset logits 2 (x, y),
/// displacements 2 (dx, dy).
///
/// A cell's score is softmax(logits)[1], times `nms_decay` unless it is the maximum of its 3 x 3
/// cells. Of the cells that reach the threshold the `max_lines` best become lines, best first,
/// equal scores in order of the cell: centre = cell + sigmoid(offset), ends = centre -+
/// displacement, the end with the smaller x (then y) first, in pixels of an image of image_width x
/// image_height px. Source: F-Clip (Dai et al. 2022), line_parsing.py and nms.py; docs/method/.
std::vector<DecodedLine> DecodeLinesReference(std::span<const float> planes,
                                              const DecodeOptions& options, int image_width_px,
                                              int image_height_px);

}  // namespace plumb
