#include "plumb/base/solve6.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace plumb {
namespace {

/// B B^T + I of a matrix without structure, column by column.
void MakePositive(double a[36]) {
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      a[6 * j + i] = i == j ? 1.0 : 0.0;
      for (int k = 0; k < 6; ++k) a[6 * j + i] += std::sin(3 * i + 5 * k) * std::sin(3 * j + 5 * k);
    }
  }
}

TEST(SolvePositive6, SolvesTheSystem) {
  double a[36], copy[36], b[6], x[6];
  MakePositive(a);
  MakePositive(copy);
  for (int i = 0; i < 6; ++i) b[i] = 1.0 + i * i;
  for (int j = 1; j < 6; ++j) {
    for (int i = 0; i < j; ++i) copy[6 * j + i] = std::nan("");  // the upper triangle is not read
  }
  ASSERT_TRUE(SolvePositive6(copy, b, x));
  for (int i = 0; i < 6; ++i) {
    double sum = 0.0;
    for (int j = 0; j < 6; ++j) sum += a[6 * j + i] * x[j];
    EXPECT_NEAR(sum, b[i], 1e-9) << i;
  }
}

TEST(SolvePositive6, RefusesWhatIsNotPositiveDefiniteOrNotFinite) {
  const double b[6] = {1, 1, 1, 1, 1, 1};
  double x[6];
  for (const double bad : {0.0, -2.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    for (const int i : {0, 3, 5}) {
      double a[36];
      MakePositive(a);
      a[7 * i] = bad;
      EXPECT_FALSE(SolvePositive6(a, b, x)) << bad << " at " << i;
    }
  }
  double off[36];
  MakePositive(off);
  off[1] = std::nan("");
  EXPECT_FALSE(SolvePositive6(off, b, x));
}

}  // namespace
}  // namespace plumb
