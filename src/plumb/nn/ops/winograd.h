// Weights of 3x3 convolutions in Winograd's F(4x4, 3x3) domain.
#pragma once

#include <array>
#include <span>

namespace plumb::nn {

inline constexpr int kWinogradPositions = 36;

/// U = G g G^T in double precision. @param kernel 3x3, row by row. @return 6x6, row by row.
/// Source: Lavin and Gray, "Fast Algorithms for Convolutional Neural Networks", points 0, +-1, +-2.
std::array<double, kWinogradPositions> WinogradKernel(std::span<const double, 9> kernel);

}  // namespace plumb::nn
