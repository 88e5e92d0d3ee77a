#include "plumb/refine/row_sums.h"

#include <algorithm>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

PLUMB_SIMD_CLONES void Multiply(size_t count, const float* __restrict a, const float* __restrict b,
                                float* __restrict product) {
  for (size_t k = 0; k < count; ++k) product[k] = a[k] * b[k];
}

/// Products of one column with six others: one load of it serves all.
PLUMB_SIMD_CLONES void Dots(size_t count, const float* __restrict a, const float* __restrict b0,
                            const float* __restrict b1, const float* __restrict b2,
                            const float* __restrict b3, const float* __restrict b4,
                            const float* __restrict b5, const float* __restrict b6,
                            float* __restrict sums) {
  float s0 = 0.0f, s1 = 0.0f, s2 = 0.0f, s3 = 0.0f, s4 = 0.0f, s5 = 0.0f, s6 = 0.0f;
  for (size_t k = 0; k < count; ++k) {
    s0 += a[k] * b0[k];
    s1 += a[k] * b1[k];
    s2 += a[k] * b2[k];
    s3 += a[k] * b3[k];
    s4 += a[k] * b4[k];
    s5 += a[k] * b5[k];
    s6 += a[k] * b6[k];
  }
  sums[0] = s0;
  sums[1] = s1;
  sums[2] = s2;
  sums[3] = s3;
  sums[4] = s4;
  sums[5] = s5;
  sums[6] = s6;
}

}  // namespace

void ResidualRows::Resize(size_t count) {
  for (std::vector<float>& column : jacobian) column.resize(count);
  residual.resize(count);
  weight.resize(count);
}

NormalEquations SumRows(const ResidualRows& rows, std::vector<float>* scratch) {
  // Long sums are cut, and added up in double precision.
  constexpr size_t kBlock = 512;
  scratch->resize(kBlock);
  NormalEquations out;
  for (size_t begin = 0; begin < rows.size(); begin += kBlock) {
    const size_t count = std::min(kBlock, rows.size() - begin);
    const auto column = [&](size_t i) { return rows.jacobian[i].data() + begin; };
    for (size_t i = 0; i < 6; ++i) {
      Multiply(count, column(i), rows.weight.data() + begin, scratch->data());
      float sums[7];
      Dots(count, scratch->data(), column(0), column(1), column(2), column(3), column(4), column(5),
           rows.residual.data() + begin, sums);
      const auto row = static_cast<Eigen::Index>(i);
      for (size_t j = 0; j <= i; ++j) {
        out.information(row, static_cast<Eigen::Index>(j)) += static_cast<double>(sums[j]);
      }
      out.gradient[row] += static_cast<double>(sums[6]);
    }
  }
  out.information.triangularView<Eigen::StrictlyUpper>() = out.information.transpose();
  return out;
}

}  // namespace plumb
