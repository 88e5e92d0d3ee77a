#include "plumb/refine/row_sums.h"

#include <algorithm>

#include "plumb/base/weighted_products.h"

namespace plumb {

void ResidualRows::Resize(size_t count) {
  for (std::vector<float>& column : jacobian) column.resize(count);
  residual.resize(count);
  weight.resize(count);
}

NormalEquations SumRows(const ResidualRows& rows) {
  // Long sums are cut, and added up in double precision.
  constexpr size_t kBlock = 512;
  NormalEquations out;
  for (size_t begin = 0; begin < rows.size(); begin += kBlock) {
    const size_t count = std::min(kBlock, rows.size() - begin);
    LeastSquaresColumns columns;
    for (size_t i = 0; i < 6; ++i) columns[i] = rows.jacobian[i].data() + begin;
    columns[6] = rows.residual.data() + begin;
    float sums[6][7];
    SumWeightedProducts(count, columns, rows.weight.data() + begin, sums);
    for (size_t i = 0; i < 6; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      for (size_t j = i; j < 6; ++j) {
        out.information(row, static_cast<Eigen::Index>(j)) += static_cast<double>(sums[i][j]);
      }
      out.gradient[row] += static_cast<double>(sums[i][6]);
    }
  }
  out.information.triangularView<Eigen::StrictlyLower>() = out.information.transpose();
  return out;
}

}  // namespace plumb
