// Single segments against the image's edges: move on to the ridge, cut to where the edge is.
// With a rectifier, segments lie in the ideal image and their edges, curved, in the taken one:
// widths across an edge are pixels of the taken image, where its blur and noise are the same
// everywhere.
#pragma once

#include "plumb/features/blurred_image.h"
#include "plumb/geometry/rectifier.h"
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
/// @param rectifier      Of the image; null: it has no lens.
/// @return whether a ridge was found. Allocation-free.
/// Source: docs/method/association.md, "Segments: detect, then move on to the ridge".
bool MoveToRidge(const BlurredImage& image, double half_width_px, Segment2* segment,
                 const Rectifier* rectifier = nullptr);

/// The strongest edge that all of `segment` shares, within the wide reach: the mean derivative
/// across it [grey levels a pixel], less the farther the edge is away. 0 where the lens does not
/// image it.
double SharedEdgeStrength(const BlurredImage& image, const Segment2& segment,
                          const Rectifier* rectifier);

/// Looks beside `segment`, which lies on its edge, for the strongest edge of the opposite polarity
/// within kWideHalfWidthPx: the other border of a bar or a thin line. Which of the two borders a
/// detected segment moved on to is chance, so a view that keeps only one may lack the other view's.
///
/// @param out_border  Where it is, roughly: `segment` moved across itself; MoveToRidge() is next.
/// @return false when that edge is less than 0.6 as strong or its mean derivative below 1.5 grey
///         levels a pixel.
/// Source: docs/method/association.md, "Segments".
bool FindOtherBorder(const BlurredImage& image, const Segment2& segment, Segment2* out_border,
                     const Rectifier* rectifier = nullptr);

/// Cuts `segment`, which lies on its edge, to the longest run of places where that edge is within
/// 0.75 px and its derivative above 1.5 grey levels a pixel.
///
/// @return false, leaving the segment alone, when half or more of it has no such edge.
/// Source: docs/method/association.md, "Segments of a CNN detector".
bool TrimToEdge(const BlurredImage& image, Segment2* segment, const Rectifier* rectifier = nullptr);

}  // namespace plumb
