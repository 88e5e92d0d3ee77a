#include "plumb/points/descriptor_matcher.h"

#include <algorithm>
#include <limits>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr size_t kLength = DescriptorTable::kLength;
constexpr size_t kBlock = 64;  // 16 KB of rows stay in the first cache

/// out[k] = query . rows[k]. The largest product, 128 * 255^2, fits 32 bit.
PLUMB_SIMD_CLONES
void MultiplyRows(const int16_t* query, const int16_t* rows, size_t count, int32_t* out) {
  for (size_t k = 0; k < count; ++k) {
    const int16_t* row = rows + k * kLength;
    int32_t sum = 0;
    for (size_t i = 0; i < kLength; ++i) sum += static_cast<int32_t>(query[i]) * row[i];
    out[k] = sum;
  }
}

}  // namespace

void DescriptorTable::Clear() {
  values_.clear();
  squares_.clear();
}

void DescriptorTable::Add(const PointDescriptor& descriptor) {
  int32_t square = 0;
  for (const uint8_t value : descriptor) square += value * value;
  values_.insert(values_.end(), descriptor.begin(), descriptor.end());
  squares_.push_back(square);
}

void DescriptorMatcher::Match(const DescriptorTable& a, const DescriptorTable& b, double max_ratio,
                              std::vector<DescriptorPair>* out_pairs) {
  out_pairs->clear();
  if (b.size() < 2) return;
  constexpr int32_t kFar = std::numeric_limits<int32_t>::max();
  best_of_a_.assign(a.size(), {kFar, kFar, 0});
  best_of_b_.assign(b.size(), {kFar, kFar, 0});
  products_.resize(kBlock);
  for (size_t begin = 0; begin < b.size(); begin += kBlock) {
    const size_t count = std::min(kBlock, b.size() - begin);
    for (size_t i = 0; i < a.size(); ++i) {
      MultiplyRows(a.row(i), b.row(begin), count, products_.data());
      Best& mine = best_of_a_[i];
      for (size_t k = 0; k < count; ++k) {
        const size_t j = begin + k;
        const int32_t distance = a.square(i) + b.square(j) - 2 * products_[k];
        if (distance < mine.second) {
          if (distance < mine.first) {
            mine = {distance, mine.first, static_cast<uint32_t>(j)};
          } else {
            mine.second = distance;
          }
        }
        if (distance < best_of_b_[j].first) {
          best_of_b_[j] = {distance, kFar, static_cast<uint32_t>(i)};
        }
      }
    }
  }
  for (uint32_t i = 0; i < a.size(); ++i) {
    const Best& mine = best_of_a_[i];
    if (mine.first < max_ratio * max_ratio * mine.second && best_of_b_[mine.index].index == i) {
      out_pairs->push_back({i, mine.index});
    }
  }
}

}  // namespace plumb
