// OpenCV's line segment detector behind the common interface: no network, no GPU.
#pragma once

#include <memory>

#include "plumb/features/line_detector.h"

namespace plumb {

/// LSD (refine = standard, scale 0.8). Segments longer than 12 px, longest first; the score is
/// length / (length + 40 px), since LSD itself ranks nothing. CPU only: Submit() does the work.
/// Source: Grompone von Gioi et al., "LSD: a Line Segment Detector", IPOL 2012.
std::unique_ptr<LineDetector> CreateLsdDetector();

}  // namespace plumb
