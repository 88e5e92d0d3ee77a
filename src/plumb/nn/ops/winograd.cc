// The kernel transform of F(4x4, 3x3).
#include "plumb/nn/ops/winograd.h"

namespace plumb::nn {
namespace {

constexpr double kG[6][3] = {{1.0 / 4, 0, 0},
                             {-1.0 / 6, -1.0 / 6, -1.0 / 6},
                             {-1.0 / 6, 1.0 / 6, -1.0 / 6},
                             {1.0 / 24, 1.0 / 12, 1.0 / 6},
                             {1.0 / 24, -1.0 / 12, 1.0 / 6},
                             {0, 0, 1}};

}  // namespace

std::array<double, kWinogradPositions> WinogradKernel(std::span<const double, 9> kernel) {
  std::array<double, kWinogradPositions> result{};
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      for (int y = 0; y < 3; ++y) {
        for (int x = 0; x < 3; ++x) result[i * 6 + j] += kG[i][y] * kernel[3 * y + x] * kG[j][x];
      }
    }
  }
  return result;
}

}  // namespace plumb::nn
