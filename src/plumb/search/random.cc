#include "plumb/search/random.h"

#include <numbers>

namespace plumb {

float Random::Uniform() { return static_cast<float>(Next() >> 40) * 0x1p-24f; }

uint32_t Random::Below(uint32_t count) {
  return static_cast<uint32_t>(((Next() >> 32) * count) >> 32);
}

Eigen::Vector3f Random::Normal3(float sigma) {
  // Four uniform numbers of 16 bits each: variance 4 / 12.
  const float scale = sigma * std::numbers::sqrt3_v<float> * 0x1p-16f;
  Eigen::Vector3f out;
  for (int i = 0; i < 3; ++i) {
    const uint64_t bits = Next();
    const auto sum = static_cast<int32_t>((bits & 0xffff) + (bits >> 16 & 0xffff) +
                                          (bits >> 32 & 0xffff) + (bits >> 48));
    out[i] = scale * static_cast<float>(sum - 2 * 0xffff);
  }
  return out;
}

uint64_t MixSeeds(uint64_t a, uint64_t b) { return SplitMix64(SplitMix64(a).Next() ^ b).Next(); }

}  // namespace plumb
