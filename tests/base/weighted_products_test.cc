#include "plumb/base/weighted_products.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace plumb {
namespace {

TEST(WeightedProducts, AreTheSumsOfThePlainLoop) {
  for (const size_t count : {0u, 1u, 7u, 64u, 101u}) {
    std::vector<float> column[7], weight(count);
    LeastSquaresColumns columns;
    for (size_t c = 0; c < 7; ++c) {
      for (size_t k = 0; k < count; ++k) {
        column[c].push_back(std::sin(static_cast<float>(3 * k + 7 * c)));
      }
      columns[c] = column[c].data();
    }
    for (size_t k = 0; k < count; ++k) weight[k] = static_cast<float>(k % 5);
    float sums[6][7];
    SumWeightedProducts(count, columns, weight.data(), sums);
    for (size_t i = 0; i < 6; ++i) {
      for (size_t j = i; j < 7; ++j) {
        double expected = 0.0;
        for (size_t k = 0; k < count; ++k) {
          expected += static_cast<double>(weight[k]) * static_cast<double>(column[i][k]) *
                      static_cast<double>(column[j][k]);
        }
        EXPECT_NEAR(static_cast<double>(sums[i][j]), expected, 1e-4)
            << count << ' ' << i << ' ' << j;
      }
    }
  }
}

}  // namespace
}  // namespace plumb
