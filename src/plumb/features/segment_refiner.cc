#include "plumb/features/segment_refiner.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "plumb/features/blurred_image.h"
#include "plumb/features/luminance.h"
#include "plumb/features/segment_ridge.h"
#include "plumb/features/straighten.h"

namespace plumb {
namespace {

constexpr uint32_t kMaxSegments = 4096;
// Beyond this a coordinate cannot belong to an image (16384 px a side) and would only cost digits.
constexpr double kMaxCoordinatePx = 1e5;
constexpr double kMaxBendPx = 1.0;  // a ridge within it is found from either line

bool IsUsable(const Segment2& segment) {
  // Written so that NaN fails.
  return segment.start.cwiseAbs().maxCoeff() < kMaxCoordinatePx &&
         segment.end.cwiseAbs().maxCoeff() < kMaxCoordinatePx && std::isfinite(segment.score);
}

// A kept segment, prepared for the comparison with many others.
struct KeptSegment {
  Eigen::Vector2d start, unit;
  double length = 0.0;
};

// Whether more than 70 % of `segment` lies within 1.5 px of `kept`, nearly parallel to it.
bool IsCoveredBy(const Eigen::Vector2d& start, const Eigen::Vector2d& unit, double length,
                 const KeptSegment& kept) {
  constexpr double kMaxSine = 0.05, kMaxDistancePx = 1.5, kMinShare = 0.7;
  const double sine = kept.unit.x() * unit.y() - kept.unit.y() * unit.x();
  if (std::abs(sine) >= kMaxSine) return false;
  const Eigen::Vector2d relative = start - kept.start;
  // Along the segment, at distance s from its start: position along `kept` and distance from it.
  const double along = kept.unit.dot(relative);
  const double across = kept.unit.x() * relative.y() - kept.unit.y() * relative.x();
  const double cosine = kept.unit.dot(unit);
  // s for which 0 <= along + s * cosine <= kept.length; |cosine| is nearly one.
  double s0 = -along / cosine, s1 = (kept.length - along) / cosine;
  if (s0 > s1) std::swap(s0, s1);
  s0 = std::max(s0, 0.0);
  s1 = std::min(s1, length);
  // s for which |across + s * sine| < 1.5 px.
  if (std::abs(sine) < 1e-9) {
    if (std::abs(across) >= kMaxDistancePx) return false;
  } else {
    double d0 = (-kMaxDistancePx - across) / sine, d1 = (kMaxDistancePx - across) / sine;
    if (d0 > d1) std::swap(d0, d1);
    s0 = std::max(s0, d0);
    s1 = std::min(s1, d1);
  }
  return s1 - s0 > kMinShare * length;
}

}  // namespace

struct SegmentRefiner::Impl {
  SegmentRefinerOptions options;
  BlurredImage blurred;
  std::vector<uint8_t> gray;
  std::vector<Segment2> candidates;
  std::vector<KeptSegment> kept;
  const Rectifier* rectifier = nullptr;  // of the image at hand, if it has a lens

  bool IsLongEnough(const Segment2& segment) const {
    return segment.Length() > options.min_length_px;
  }

  // The same for a refined segment, which a lens images with another length.
  bool IsLongEnoughInImage(const Segment2& segment) const {
    if (rectifier == nullptr) return IsLongEnough(segment);
    const auto start = rectifier->ToImage(segment.start), end = rectifier->ToImage(segment.end);
    return start && end && IsLongEnough({start->px, end->px});
  }

  void SelectCandidates(std::span<const Segment2> segments) {
    candidates.clear();
    for (const Segment2& segment : segments) {
      if (IsUsable(segment) && IsLongEnough(segment)) candidates.push_back(segment);
    }
    const auto is_better = [](const Segment2& a, const Segment2& b) { return a.score > b.score; };
    // Detectors sort already; stable_sort allocates.
    if (!std::is_sorted(candidates.begin(), candidates.end(), is_better)) {
      std::stable_sort(candidates.begin(), candidates.end(), is_better);
    }
    size_t count = 0;
    while (count < candidates.size() && candidates[count].score >= options.min_score) ++count;
    count = std::max<size_t>(count, options.min_count);
    count = std::min<size_t>(count, options.max_count);
    candidates.resize(std::min(count, candidates.size()));
  }

  // Into the ideal image. Where the edge's curve is bent by more than kMaxBendPx, the image tells
  // which points of it the detector met.
  bool Straighten(Segment2* segment) const {
    const auto straight = StraightenSegment(*rectifier, *segment);
    if (!straight) return false;
    *segment = straight->nearest;
    const double bend = (straight->nearest.Midpoint() - straight->through_ends.Midpoint()).norm();
    if (bend > kMaxBendPx && SharedEdgeStrength(blurred, straight->through_ends, rectifier) >
                                 SharedEdgeStrength(blurred, straight->nearest, rectifier)) {
      *segment = straight->through_ends;
    }
    return true;
  }

  bool MoveOnEdge(Segment2* segment) const {
    if (rectifier != nullptr && !Straighten(segment)) return false;
    MoveToRidge(blurred, kWideHalfWidthPx, segment, rectifier);
    MoveToRidge(blurred, kNarrowHalfWidthPx, segment, rectifier);
    return CutToEdge(segment);
  }

  bool MoveOnOtherBorder(const Segment2& segment, Segment2* border) const {
    return FindOtherBorder(blurred, segment, border, rectifier) &&
           MoveToRidge(blurred, kNarrowHalfWidthPx, border, rectifier) && CutToEdge(border);
  }

  bool CutToEdge(Segment2* segment) const {
    if (options.trim) {
      if (!TrimToEdge(blurred, segment, rectifier)) return false;
      MoveToRidge(blurred, kNarrowHalfWidthPx, segment, rectifier);
    }
    return IsLongEnoughInImage(*segment);
  }

  // Appends the segment unless duplicates are to go and one that was kept before explains it.
  bool Keep(const Segment2& segment, std::vector<Segment2>* out_segments) {
    if (options.remove_duplicates && IsDuplicate(segment)) return false;
    out_segments->push_back(segment);
    return true;
  }

  // Otherwise remembers the segment.
  bool IsDuplicate(const Segment2& segment) {
    const double length = segment.Length();
    const Eigen::Vector2d unit = segment.Delta() / length;
    for (const KeptSegment& other : kept) {
      if (IsCoveredBy(segment.start, unit, length, other)) return true;
    }
    kept.push_back({segment.start, unit, length});
    return false;
  }
};

SegmentRefiner::SegmentRefiner(const SegmentRefinerOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  impl_->options.max_count = std::clamp(options.max_count, uint32_t{1}, kMaxSegments);
  impl_->options.min_length_px = std::max(options.min_length_px, 1.0);
}

SegmentRefiner::~SegmentRefiner() = default;

std::vector<Segment2> SegmentRefiner::Refine(const ImageView& image,
                                             std::span<const Segment2> segments,
                                             const Rectifier* rectifier) {
  std::vector<Segment2> refined;
  Refine(image, segments, &refined, rectifier);
  return refined;
}

void SegmentRefiner::Refine(const ImageView& image, std::span<const Segment2> segments,
                            std::vector<Segment2>* out_segments, const Rectifier* rectifier) {
  out_segments->clear();
  if (!image.Validate()) return;
  impl_->rectifier = rectifier != nullptr && !rectifier->IsIdentity() ? rectifier : nullptr;
  impl_->SelectCandidates(segments);
  if (impl_->candidates.empty()) return;
  impl_->blurred.Assign(Luminance(image, &impl_->gray));
  impl_->kept.clear();
  out_segments->reserve(2 * impl_->candidates.size());
  Segment2 border;
  for (Segment2 segment : impl_->candidates) {
    if (!impl_->MoveOnEdge(&segment) || !impl_->Keep(segment, out_segments)) continue;
    if (impl_->options.add_other_borders && impl_->MoveOnOtherBorder(segment, &border)) {
      impl_->Keep(border, out_segments);
    }
  }
}

}  // namespace plumb
