// Pixel metrics F^H and AP^H of line detectors: the lines drawn and compared as pixels.
#pragma once

#include <span>

#include "tools/metrics/structural_ap.h"

namespace plumb::tools {

struct PixelScores {
  double f_percent = 0.0;   // F^H: best F over the score thresholds
  double ap_percent = 0.0;  // AP^H: area under the monotone envelope of precision over recall
};

/// Draws detections and annotation one pixel wide in each image's own size, matches the pixels one
/// to one within 0.01 of the image's diagonal (PixelMatcher), and sums matched, drawn and annotated
/// pixels over all images, once for each of the score thresholds 0.02, 0.04 .. 0.98.
/// Precision and recall 0 where nothing is drawn or annotated.
/// Source: Huang et al., "Learning to Parse Wireframes", CVPR 2018, Sec. 5; docs/evaluation.md.
PixelScores EvaluatePixels(std::span<const LineEvaluation> images);

}  // namespace plumb::tools
