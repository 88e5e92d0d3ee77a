// The sums of a weighted least-squares step, several rows at a time.
#pragma once

#include <array>
#include <cstddef>

namespace plumb {

/// Columns of six unknowns and the column of residuals, one entry a row.
using LeastSquaresColumns = std::array<const float*, 7>;

/// sums[i][j] = sum over `count` rows of weight x column i x column j, for the six unknowns i and
/// the columns j >= i: the upper triangle of J^T W J, and in the last column J^T W r. The sums
/// below the diagonal are not written.
void SumWeightedProducts(size_t count, const LeastSquaresColumns& columns, const float* weight,
                         float sums[6][7]);

}  // namespace plumb
