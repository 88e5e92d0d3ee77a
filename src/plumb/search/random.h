// The search's own random numbers: equal seeds give equal draws on every standard library.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "plumb/base/split_mix64.h"

namespace plumb {

/// Draws in single precision, of which the search makes thousands a frame.
class Random : public SplitMix64 {
 public:
  using SplitMix64::SplitMix64;

  /// Uniform in [0, 1), 24 bits.
  float Uniform();
  /// Uniform in 0..count - 1, count > 0.
  uint32_t Below(uint32_t count);
  /// Three independent, nearly normal numbers with the standard deviation `sigma` each: sums of
  /// four uniform ones, hence never beyond 3.47 sigma.
  Eigen::Vector3f Normal3(float sigma);
};

/// One seed out of two, such that neighbouring pairs give unrelated draws.
uint64_t MixSeeds(uint64_t a, uint64_t b);

}  // namespace plumb
