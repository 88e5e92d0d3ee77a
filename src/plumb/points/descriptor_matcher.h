// Exhaustive matching of two sets of SIFT descriptors, both ways in one pass.
#pragma once

#include <cstdint>
#include <vector>

#include "plumb/points/point_features.h"

namespace plumb {

/// Descriptors widened to 16 bit, which vector units multiply fastest.
class DescriptorTable {
 public:
  void Clear();
  void Add(const PointDescriptor& descriptor);

  size_t size() const { return squares_.size(); }
  const int16_t* row(size_t i) const { return values_.data() + i * kLength; }
  int32_t square(size_t i) const { return squares_[i]; }  // squared norm

  static constexpr size_t kLength = 128;

 private:
  std::vector<int16_t> values_;
  std::vector<int32_t> squares_;
};

/// Row `a` of one table looks like row `b` of the other.
struct DescriptorPair {
  uint32_t a = 0, b = 0;
};

/// Owns the work space; not thread-safe.
class DescriptorMatcher {
 public:
  /// Pairs that are each other's nearest and whose distance is less than `max_ratio` times that of
  /// a's second nearest. Ties go to the smaller index. Ascending in `a`; none when `b` has fewer
  /// than two rows.
  /// Source: Lowe, IJCV 2004, Sec. 7.1.
  void Match(const DescriptorTable& a, const DescriptorTable& b, double max_ratio,
             std::vector<DescriptorPair>* out_pairs);

 private:
  struct Best {
    int32_t first, second;  // squared distances
    uint32_t index;         // of the first
  };
  std::vector<Best> best_of_a_, best_of_b_;
  std::vector<int32_t> products_;
};

}  // namespace plumb
