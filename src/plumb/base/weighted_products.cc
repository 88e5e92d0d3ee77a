#include "plumb/base/weighted_products.h"

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

PLUMB_SIMD_CLONES void Multiply(size_t count, const float* __restrict a, const float* __restrict b,
                                float* __restrict product) {
  for (size_t k = 0; k < count; ++k) product[k] = a[k] * b[k];
}

/// Products of one column with all seven: one load of it serves all.
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

void SumWeightedProducts(size_t count, const LeastSquaresColumns& columns, const float* weight,
                         float* scratch, float sums[6][7]) {
  for (size_t i = 0; i < 6; ++i) {
    Multiply(count, columns[i], weight, scratch);
    Dots(count, scratch, columns[0], columns[1], columns[2], columns[3], columns[4], columns[5],
         columns[6], sums[i]);
  }
}

}  // namespace plumb
