#include "plumb/base/median.h"

#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

double MedianOf(std::vector<double> values) { return Median(values); }

TEST(Median, IsTheMiddleOneOrTheUpperOfTwo) {
  EXPECT_EQ(MedianOf({}), 0.0);
  EXPECT_EQ(MedianOf({7.0}), 7.0);
  EXPECT_EQ(MedianOf({5.0, -1.0}), 5.0);
  EXPECT_EQ(MedianOf({3.0, 9.0, 1.0}), 3.0);
  EXPECT_EQ(MedianOf({4.0, 1.0, 3.0, 2.0}), 3.0);
  EXPECT_EQ(MedianOf({2.0, 2.0, 2.0, 0.0}), 2.0);
}

}  // namespace
}  // namespace plumb
