#include "plumb/matching/pair_list.h"

#include <algorithm>
#include <bit>
#include <numbers>

#include "plumb/base/simd_clones.h"
#include "plumb/matching/overlap_geometry.h"

namespace plumb {
namespace {

constexpr size_t kLanes = SegmentTable::kLanes;
constexpr float kGateSigmas = 3.0f;
constexpr float kOutlierMass = 0.1f;
constexpr float kFragmentsPerLine = 1.5f;
// Lines know their angle to 0.004 rad.
constexpr float kAngleSlack = 0.005f;
// What a list leaves to the pose that moves: of the sine, of the shares.
constexpr float kSineSlack = 0.02f, kShareSlack = 0.1f;

size_t Padded(size_t count) { return (count + kLanes - 1) / kLanes * kLanes; }

/// Smallest distances first, then overlaps, then shares; all of them exclusive.
struct Limits {
  float square, sine, overlap, share;
};

Limits LimitsOf(const AssociationGates& gates, float slack_px) {
  const float distance = kGateSigmas * static_cast<float>(gates.sigma_px) + slack_px;
  const bool exact = slack_px <= 0.0f;
  return {
      distance * distance,
      kGateSigmas * static_cast<float>(gates.sigma_sine) + (exact ? 0.0f : kSineSlack),
      std::max(static_cast<float>(gates.min_overlap_px) - slack_px, 0.0f),
      std::max(static_cast<float>(gates.min_overlap_share) - (exact ? 0.0f : kShareSlack), 0.0f)};
}

/// 1 or 0, without branches.
inline int32_t IsInside(const OverlapGeometry& o, const Limits& limits, float line_length,
                        float segment_length) {
  return (o.square < limits.square) & (o.sine < limits.sine) & (o.overlap > limits.overlap) &
         (o.overlap > limits.share * std::min(line_length, segment_length));
}

PLUMB_SIMD_CLONES void InsideKernel(const ImageLine line, const Limits limits, size_t count,
                                    const float* __restrict x0, const float* __restrict y0,
                                    const float* __restrict x1, const float* __restrict y1,
                                    const float* __restrict dx, const float* __restrict dy,
                                    const float* __restrict length, int32_t* __restrict inside) {
  for (size_t k = 0; k < count; ++k) {
    const OverlapGeometry o = MeasureOverlap(line, x0[k], y0[k], x1[k], y1[k], dx[k], dy[k]);
    inside[k] = IsInside(o, limits, line.length, length[k]);
  }
}

/// exp(x) for x in -80..0, relative error 2e-7.
inline float Exp(float x) {
  const float t = x * std::numbers::log2e_v<float>;
  const auto whole = static_cast<int32_t>(t - 0.5f);
  const float f = (t - static_cast<float>(whole)) * std::numbers::ln2_v<float>;
  const float p =
      1.0f + f * (1.0f + f * (0.5f + f * (1.0f / 6.0f +
                                          f * (1.0f / 24.0f + f * (1.0f / 120.0f + f / 720.0f)))));
  return p * std::bit_cast<float>((whole + 127) << 23);
}

PLUMB_SIMD_CLONES void WeighKernel(const Limits limits, float square_factor, float sine_factor,
                                   size_t count, const int32_t* __restrict row,
                                   const float* __restrict line_x, const float* __restrict line_y,
                                   const float* __restrict line_dx, const float* __restrict line_dy,
                                   const float* __restrict line_length, const float* __restrict x0,
                                   const float* __restrict y0, const float* __restrict x1,
                                   const float* __restrict y1, const float* __restrict dx,
                                   const float* __restrict dy, const float* __restrict length,
                                   float* __restrict e, float* __restrict out_overlap,
                                   float* __restrict out_begin, float* __restrict out_end,
                                   float* __restrict out_square) {
  for (size_t k = 0; k < count; ++k) {
    const int32_t i = row[k];
    const ImageLine line{line_x[i], line_y[i], line_dx[i], line_dy[i], line_length[i]};
    const OverlapGeometry o = MeasureOverlap(line, x0[k], y0[k], x1[k], y1[k], dx[k], dy[k]);
    const int32_t inside = IsInside(o, limits, line.length, length[k]);
    // Far pairs are clamped, not skipped: the loop has no branch.
    const float value =
        Exp(std::max(square_factor * o.square + sine_factor * o.sine * o.sine, -60.0f));
    // A mask, since a condition would become a branch.
    e[k] = std::bit_cast<float>(std::bit_cast<int32_t>(value) & -inside);
    out_overlap[k] = o.overlap;
    out_begin[k] = o.begin;
    out_end[k] = o.end;
    out_square[k] = o.square;
  }
}

PLUMB_SIMD_CLONES void GatherKernel(size_t count, const int32_t* __restrict index,
                                    const float* __restrict in, float* __restrict out) {
  for (size_t k = 0; k < count; ++k) out[k] = in[index[k]];
}

}  // namespace

void PairList::Pairs::Resize(size_t count) {
  line.resize(count);
  segment.resize(count);
  for (std::vector<float>* column :
       {&weight, &overlap, &begin, &end, &x0, &y0, &x1, &y1, &square}) {
    column->resize(count);
  }
}

void PairList::Build(const ProjectedLines& lines, const SegmentTable& segments,
                     const AssociationGates& gates, double slack_px) {
  const Limits limits = LimitsOf(gates, static_cast<float>(slack_px));
  const float half_width =
      limits.sine < 1.0f ? std::asin(limits.sine) + kAngleSlack : std::numbers::pi_v<float>;
  num_lines_ = lines.size();
  num_segments_ = segments.size();
  if (inside_.size() < segments.size() + kLanes) inside_.resize(segments.size() + kLanes);
  // Every row is written and the next one takes its place unless it is inside: the outcome is too
  // irregular for a branch.
  if (line_.size() < kMaxPairs + segments.size() + kLanes) {
    line_.resize(kMaxPairs + segments.size() + kLanes);
    segment_.resize(line_.size());
  }
  size_t listed = 0;
  for (size_t i = 0; i < lines.size() && listed < kMaxPairs; ++i) {
    if (!(lines.length[i] > 0.0f)) continue;
    const ImageLine line{lines.x[i], lines.y[i], lines.direction_x[i], lines.direction_y[i],
                         lines.length[i]};
    for (const SegmentTable::Range range : segments.Within(lines.angle[i], half_width)) {
      const size_t b = range.begin, count = range.end - range.begin;
      if (count == 0) continue;
      InsideKernel(line, limits, Padded(count), segments.x0.data() + b, segments.y0.data() + b,
                   segments.x1.data() + b, segments.y1.data() + b, segments.direction_x.data() + b,
                   segments.direction_y.data() + b, segments.length.data() + b, inside_.data());
      for (size_t k = 0; k < count; ++k) {
        line_[listed] = static_cast<int32_t>(i);
        segment_[listed] = static_cast<int32_t>(b + k);
        listed += static_cast<size_t>(inside_[k]);
      }
    }
  }
  num_listed_ = std::min(listed, kMaxPairs);
  const size_t padded = Padded(num_listed_);
  for (size_t k = num_listed_; k < padded; ++k) {
    line_[k] = 0;
    // The row after the last is padding that overlaps nothing.
    segment_[k] = static_cast<int32_t>(segments.size());
  }
  const auto gather = [&](const std::vector<float>& in, std::vector<float>* out) {
    out->resize(padded);
    GatherKernel(padded, segment_.data(), in.data(), out->data());
  };
  gather(segments.x0, &x0_);
  gather(segments.y0, &y0_);
  gather(segments.x1, &x1_);
  gather(segments.y1, &y1_);
  gather(segments.direction_x, &direction_x_);
  gather(segments.direction_y, &direction_y_);
  gather(segments.length, &length_);
  for (std::vector<float>* column : {&e_, &overlap_, &begin_, &end_, &square_}) {
    column->resize(padded);
  }
  kept_.resize(padded + 1);
  goes_on_.resize(padded);
  for (size_t k = 0; k < num_listed_; ++k) {
    goes_on_[k] = static_cast<float>(k > 0 && line_[k] == line_[k - 1]);
  }
  line_sum_.resize(num_lines_);
  segment_sum_.resize(num_segments_);
}

void PairList::Weigh(const ProjectedLines& lines, const AssociationGates& gates) {
  const size_t padded = x0_.size();
  WeighKernel(LimitsOf(gates, 0.0f), static_cast<float>(-0.5 / (gates.sigma_px * gates.sigma_px)),
              static_cast<float>(-0.5 / (gates.sigma_sine * gates.sigma_sine)), padded,
              line_.data(), lines.x.data(), lines.y.data(), lines.direction_x.data(),
              lines.direction_y.data(), lines.length.data(), x0_.data(), y0_.data(), x1_.data(),
              y1_.data(), direction_x_.data(), direction_y_.data(), length_.data(), e_.data(),
              overlap_.data(), begin_.data(), end_.data(), square_.data());
  std::fill(segment_sum_.begin(), segment_sum_.end(), kOutlierMass);
  // Pairs outside the gates have e = 0, so that all are summed without a branch. Those of a line
  // are neighbours: their sum is carried in a register, not waited for in memory.
  size_t kept = 0;
  float sum = 0.0f;
  for (size_t k = 0; k < num_listed_; ++k) {
    sum = sum * goes_on_[k] + ((1.0f - goes_on_[k]) * kOutlierMass + e_[k]);
    line_sum_[static_cast<size_t>(line_[k])] = sum;
    segment_sum_[static_cast<size_t>(segment_[k])] += e_[k];
    kept_[kept] = static_cast<int32_t>(k);
    kept += static_cast<size_t>(e_[k] > 0.0f);
  }
  pairs_.Resize(kept);
  for (size_t p = 0; p < kept; ++p) {
    const auto k = static_cast<size_t>(kept_[p]);
    const float bound = std::min(1.0f / segment_sum_[static_cast<size_t>(segment_[k])],
                                 kFragmentsPerLine / line_sum_[static_cast<size_t>(line_[k])]);
    pairs_.line[p] = line_[k];
    pairs_.segment[p] = segment_[k];
    pairs_.weight[p] = e_[k] * bound;
    pairs_.overlap[p] = overlap_[k];
    pairs_.begin[p] = begin_[k];
    pairs_.end[p] = end_[k];
    pairs_.x0[p] = x0_[k] + begin_[k] * (x1_[k] - x0_[k]);
    pairs_.y0[p] = y0_[k] + begin_[k] * (y1_[k] - y0_[k]);
    pairs_.x1[p] = x0_[k] + end_[k] * (x1_[k] - x0_[k]);
    pairs_.y1[p] = y0_[k] + end_[k] * (y1_[k] - y0_[k]);
    pairs_.square[p] = square_[k];
  }
}

}  // namespace plumb
