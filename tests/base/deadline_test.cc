#include "plumb/base/deadline.h"

#include <chrono>
#include <thread>

#include <gtest/gtest.h>

namespace plumb {
namespace {

constexpr int64_t kSecondNs = 1'000'000'000;

TEST(Deadline, WithoutABudgetItNeverPasses) {
  EXPECT_FALSE(Deadline().HasPassed(0.0));
  EXPECT_FALSE(Deadline(0).Part(1e-9).HasPassed(0.0));
}

TEST(Deadline, PassesWhenItsShareIsSpent) {
  const Deadline deadline(kSecondNs);
  std::this_thread::sleep_for(std::chrono::milliseconds(2));
  EXPECT_TRUE(deadline.HasPassed(0.001));
  EXPECT_FALSE(Deadline(3600 * kSecondNs).HasPassed(0.5));
}

TEST(Deadline, APartEndsBeforeTheWholeAndNeverAfter) {
  const Deadline whole(3600 * kSecondNs);
  const Deadline part = whole.Part(1e-6);  // 3.6 ms
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_TRUE(part.HasPassed());
  EXPECT_FALSE(whole.HasPassed());
  const Deadline over(1);
  std::this_thread::sleep_for(std::chrono::milliseconds(1));
  const Deadline none_left = over.Part(1.0);
  std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_TRUE(none_left.HasPassed());
}

}  // namespace
}  // namespace plumb
