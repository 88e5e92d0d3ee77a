// Depths of one segment's ends according to single segments of other views, and who agrees.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

namespace plumb {

/// Depths [m] of a segment's two ends according to one segment of another view.
struct DepthHypothesis {
  std::array<double, 2> depth{}, sigma{};
  uint32_t view = 0, segment = 0;  // the other ones
};

/// Square of the larger difference of two hypotheses at the ends, in standard deviations, if it is
/// below `limit`.
std::optional<double> SquareDifferenceBelow(double limit, const DepthHypothesis& a,
                                            const DepthHypothesis& b);

/// All hypotheses of a segment. Nearly all pairs are far apart: they are compared in columns, which
/// the compiler vectorises, before any is looked at alone.
class DepthHypotheses {
 public:
  /// @param hypotheses  Borrowed; those of one view follow each other.
  explicit DepthHypotheses(std::span<const DepthHypothesis> hypotheses);

  /// Of every view's hypotheses the one nearest to `to`, first of equals: visit(index, square
  /// difference) if that is below `max_square`, in the order of the views.
  template <typename Visit>
  void ForBestOfEachView(const DepthHypothesis& to, double max_square, const Visit& visit) {
    MarkNear(to, max_square);
    const size_t none = hypotheses_.size();
    double best = max_square;
    size_t best_index = none;
    ForMarked([&](size_t k) {
      if (best_index != none && hypotheses_[k].view != hypotheses_[best_index].view) {
        visit(best_index, best);
        best = max_square;
        best_index = none;
      }
      if (const auto square = SquareDifferenceBelow(best, to, hypotheses_[k])) {
        best = *square;
        best_index = k;
      }
    });
    if (best_index != none) visit(best_index, best);
  }

 private:
  static constexpr size_t kGroup = sizeof(uint64_t);  // marks that are skipped at once

  void MarkNear(const DepthHypothesis& to, double max_square);

  template <typename Visit>
  void ForMarked(const Visit& visit) const {
    for (size_t begin = 0; begin < near_.size(); begin += kGroup) {
      uint64_t group = 0;
      std::memcpy(&group, near_.data() + begin, kGroup);
      if (group == 0) continue;
      for (size_t k = begin; k < begin + kGroup; ++k) {
        if (near_[k] != 0) visit(k);
      }
    }
  }

  std::span<const DepthHypothesis> hypotheses_;
  std::array<std::vector<double>, 2> depth_, variance_;
  std::vector<uint8_t> near_;  // a multiple of kGroup
};

}  // namespace plumb
