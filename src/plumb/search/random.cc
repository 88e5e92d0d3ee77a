#include "plumb/search/random.h"

#include <cmath>
#include <numbers>

namespace plumb {

float Random::Uniform() { return static_cast<float>(Next() >> 40) * 0x1p-24f; }

uint32_t Random::Below(uint32_t count) {
  return static_cast<uint32_t>(((Next() >> 32) * count) >> 32);
}

Eigen::Vector3f Random::Normal3(float sigma) {
  float radius[2], angle[2];
  for (int i = 0; i < 2; ++i) {
    radius[i] = sigma * std::sqrt(-2.0f * std::log(1.0f - Uniform()));
    angle[i] = 2.0f * std::numbers::pi_v<float> * Uniform();
  }
  return {radius[0] * std::cos(angle[0]), radius[0] * std::sin(angle[0]),
          radius[1] * std::cos(angle[1])};
}

uint64_t MixSeeds(uint64_t a, uint64_t b) { return SplitMix64(SplitMix64(a).Next() ^ b).Next(); }

}  // namespace plumb
