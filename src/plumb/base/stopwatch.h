// Time between two points of the program.
#pragma once

#include <chrono>
#include <cstdint>

namespace plumb {

/// Steady clock, started on construction. Reading it costs some 25 ns.
class Stopwatch {
 public:
  /// Nanoseconds since the start or the last Lap().
  int64_t Lap() {
    const Clock::time_point now = Clock::now();
    const Clock::time_point last = last_;
    last_ = now;
    return std::chrono::duration_cast<std::chrono::nanoseconds>(now - last).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_ = Clock::now();
};

}  // namespace plumb
