// Structural average precision (sAP) of line detectors, the protocol of L-CNN.
#pragma once

#include <span>
#include <vector>

#include "plumb/geometry/segment.h"

namespace plumb::tools {

/// Detections and annotation of one image, both in its pixels.
struct LineEvaluation {
  int width_px = 0, height_px = 0;
  std::vector<Segment2> detected;  // any order; `score` ranks them
  std::vector<Segment2> annotated;
};

/// Scales both axes to 128, so that d = sum of the squared distances of the end points (the better
/// of the two orders). By descending score each detection takes its nearest annotated line; it is a
/// hit if d < `threshold` and no better detection of its image hit that line before (there is no
/// fall-back to the second nearest). The area under the monotone envelope of the precision-recall
/// curve over all images is the result, in percent: 0..100; 0 if nothing was annotated or detected.
/// Source: Zhou et al., "End-to-End Wireframe Parsing", ICCV 2019, Sec. 4.3.
double StructuralAp(std::span<const LineEvaluation> images, double threshold);

/// What keeping only the detections with at least this score would give.
struct OperatingPoint {
  double min_score = 0.0;
  double precision = 0.0, recall = 0.0, f = 0.0;  // 0..1; precision 1 where nothing is left
};

/// Precision and recall of the same hits for the score thresholds 0.00, 0.01 .. 1.00.
std::vector<OperatingPoint> StructuralCurve(std::span<const LineEvaluation> images,
                                            double threshold);

}  // namespace plumb::tools
