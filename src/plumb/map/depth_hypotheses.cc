#include "plumb/map/depth_hypotheses.h"

#include <algorithm>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

struct EndColumns {
  const double* depth;
  const double* variance;
  double to_depth, to_variance;
};

PLUMB_SIMD_CLONES
void MarkBelow(const EndColumns& start, const EndColumns& end, double limit, size_t count,
               uint8_t* __restrict out_near) {
  const double* depth0 = start.depth;
  const double* depth1 = end.depth;
  const double* variance0 = start.variance;
  const double* variance1 = end.variance;
  for (size_t k = 0; k < count; ++k) {
    const double difference0 = depth0[k] - start.to_depth;
    const double difference1 = depth1[k] - end.to_depth;
    const bool near0 = difference0 * difference0 < limit * (variance0[k] + start.to_variance);
    const bool near1 = difference1 * difference1 < limit * (variance1[k] + end.to_variance);
    out_near[k] = static_cast<uint8_t>(near0 & near1);
  }
}

}  // namespace

std::optional<double> SquareDifferenceBelow(double limit, const DepthHypothesis& a,
                                            const DepthHypothesis& b) {
  std::array<double, 2> square{}, variance{};
  for (int end = 0; end < 2; ++end) {
    const double difference = a.depth[end] - b.depth[end];
    square[end] = difference * difference;
    variance[end] = a.sigma[end] * a.sigma[end] + b.sigma[end] * b.sigma[end];
    if (!(square[end] < limit * variance[end])) return std::nullopt;
  }
  return std::max(square[0] / variance[0], square[1] / variance[1]);
}

DepthHypotheses::DepthHypotheses(std::span<const DepthHypothesis> hypotheses)
    : hypotheses_(hypotheses),
      near_((hypotheses.size() + kGroup - 1) / kGroup * kGroup, uint8_t{0}) {
  for (int end = 0; end < 2; ++end) {
    depth_[end].reserve(hypotheses.size());
    variance_[end].reserve(hypotheses.size());
    for (const DepthHypothesis& hypothesis : hypotheses) {
      depth_[end].push_back(hypothesis.depth[end]);
      variance_[end].push_back(hypothesis.sigma[end] * hypothesis.sigma[end]);
    }
  }
}

void DepthHypotheses::MarkNear(const DepthHypothesis& to, double max_square) {
  const auto columns = [&](int end) {
    return EndColumns{depth_[end].data(), variance_[end].data(), to.depth[end],
                      to.sigma[end] * to.sigma[end]};
  };
  MarkBelow(columns(0), columns(1), max_square, hypotheses_.size(), near_.data());
}

}  // namespace plumb
