// The kernel transform, against a convolution written out.
#include "plumb/nn/ops/winograd.h"

#include <gtest/gtest.h>

namespace plumb::nn {
namespace {

TEST(Winograd, TransformedKernelConvolvesTilesExactly) {
  constexpr double kBt[6][6] = {{4, 0, -5, 0, 1, 0},  {0, -4, -4, 1, 1, 0}, {0, 4, -4, -1, 1, 0},
                                {0, -2, -1, 2, 1, 0}, {0, 2, -1, -2, 1, 0}, {0, 4, 0, -5, 0, 1}};
  constexpr double kAt[4][6] = {
      {1, 1, 1, 1, 1, 0}, {0, 1, -1, 2, -2, 0}, {0, 1, 1, 4, 4, 0}, {0, 1, -1, 8, -8, 1}};
  double input[6][6];
  std::array<double, 9> kernel;
  for (int i = 0; i < 36; ++i) input[i / 6][i % 6] = (i * 37 % 23) - 11;
  for (int i = 0; i < 9; ++i) kernel[i] = (i * 5 % 7) - 3;
  const auto transformed = WinogradKernel(kernel);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      double expected = 0, actual = 0;
      for (int t = 0; t < 9; ++t) expected += kernel[t] * input[y + t / 3][x + t % 3];
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) {
          double v = 0;
          for (int a = 0; a < 6; ++a) {
            for (int b = 0; b < 6; ++b) v += kBt[i][a] * input[a][b] * kBt[j][b];
          }
          actual += kAt[y][i] * kAt[x][j] * v * transformed[6 * i + j];
        }
      }
      EXPECT_NEAR(actual, expected, 1e-10);
    }
  }
}

TEST(Winograd, ZeroStaysZero) {
  const std::array<double, 9> kernel{};
  for (const double value : WinogradKernel(kernel)) EXPECT_EQ(value, 0);
}

}  // namespace
}  // namespace plumb::nn
