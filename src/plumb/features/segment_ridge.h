// Single segments against the image's edges: move on to the ridge, cut to where the edge is.
#pragma once

#include "plumb/features/blurred_image.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// Half width of the profile across the segment in the first and in every further pass [px].
inline constexpr double kWideHalfWidthPx = 4.0;
inline constexpr double kNarrowHalfWidthPx = 2.5;

/// Moves both ends of `segment` across it on to the ridge of the directional derivative: 24
/// profiles across, the strongest derivative of the dominant polarity in each, and a robust
/// straight line through them. Leaves the segment alone when there is no such ridge.
///
/// @param half_width_px  kWideHalfWidthPx or kNarrowHalfWidthPx.
/// @param segment        Finite, longer than 0; may leave the image (its border repeats).
/// @return whether a ridge was found. Allocation-free.
/// Source: docs/method/association.md, "Segments: detect, then move on to the ridge".
bool MoveToRidge(const BlurredImage& image, double half_width_px, Segment2* segment);

/// Looks beside `segment`, which lies on its edge, for the strongest edge of the opposite polarity
/// within kWideHalfWidthPx: the other border of a bar or a thin line. Which of the two borders a
/// detected segment moved on to is chance, so a view that keeps only one may lack the other view's.
///
/// @param out_border  Where it is, roughly: `segment` moved across itself; MoveToRidge() is next.
/// @return false when that edge is less than 0.6 as strong or its mean derivative below 1.5 grey
///         levels a pixel.
/// Source: docs/method/association.md, "Segments".
bool FindOtherBorder(const BlurredImage& image, const Segment2& segment, Segment2* out_border);

/// Cuts `segment`, which lies on its edge, to the longest run of places where that edge is within
/// 0.75 px and its derivative above 1.5 grey levels a pixel.
///
/// @return false, leaving the segment alone, when half or more of it has no such edge.
/// Source: docs/method/association.md, "Segments of a CNN detector".
bool TrimToEdge(const BlurredImage& image, Segment2* segment);

}  // namespace plumb
