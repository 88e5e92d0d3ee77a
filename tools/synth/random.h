// The draws that a scene is made of.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "plumb/base/split_mix64.h"

namespace plumb::synth {

/// Draws in double precision.
class Random : public SplitMix64 {
 public:
  using SplitMix64::SplitMix64;

  /// [0, 1).
  double Uniform() { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  /// 0 .. count - 1, count > 0.
  int Index(int count) { return static_cast<int>(Next() % static_cast<uint64_t>(count)); }
  bool Chance(double probability) { return Uniform() < probability; }
  /// N(0, 1), by Box and Muller.
  double Normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * Uniform());
  }
};

}  // namespace plumb::synth
