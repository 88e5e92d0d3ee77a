// A time budget that work may look at.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace plumb {

/// Starts on construction. Without a budget it never passes and never reads the clock, so that what
/// asks it stays reproducible.
class Deadline {
 public:
  Deadline() = default;
  /// @param budget_ns  0: no budget.
  explicit Deadline(int64_t budget_ns) : budget_ns_(budget_ns) {
    if (budget_ns > 0) start_ = Clock::now();
  }

  /// A deadline of its own for work that may take `share` of what is left.
  Deadline Part(double share) const {
    if (budget_ns_ <= 0) return {};
    const auto spent = std::chrono::duration<double, std::nano>(Clock::now() - start_).count();
    const double left = share * (static_cast<double>(budget_ns_) - spent);
    return Deadline(std::max<int64_t>(1, static_cast<int64_t>(left)));
  }

  /// Whether more than `share` of the budget is spent.
  bool HasPassed(double share = 1.0) const {
    if (budget_ns_ <= 0) return false;
    const auto spent = std::chrono::duration<double, std::nano>(Clock::now() - start_).count();
    return spent > share * static_cast<double>(budget_ns_);
  }

 private:
  using Clock = std::chrono::steady_clock;
  int64_t budget_ns_ = 0;
  Clock::time_point start_;
};

}  // namespace plumb
