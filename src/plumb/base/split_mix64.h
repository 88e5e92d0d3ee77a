// The generator of every reproducible random number: equal seeds, equal numbers, on every machine.
#pragma once

#include <cstdint>

namespace plumb {

/// SplitMix64 (Steele, Lea, Flood 2014). Copying it forks the sequence. Not for secrets.
class SplitMix64 {
 public:
  explicit SplitMix64(uint64_t seed) : state_(seed) {}

  uint64_t Next() {
    state_ += 0x9e3779b97f4a7c15u;
    return Mix(state_);
  }

  /// A well mixed function of `x`, for values that belong to a place instead of a sequence.
  static uint64_t Mix(uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
  }

 private:
  uint64_t state_;
};

}  // namespace plumb
