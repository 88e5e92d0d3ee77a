// A symmetric system of six equations, as every Gauss-Newton step of a pose has one.
#pragma once

#include <cmath>

namespace plumb {

/// Solves A x = b for a symmetric, positive definite A, of which only the lower triangle is read
/// (element (i, j) at a[6 j + i], i >= j: Eigen's order). A is overwritten.
/// @return false, and x undefined, if A is not positive definite or not finite.
inline bool SolvePositive6(double a[36], const double b[6], double x[6]) {
  // A = L D L^T: L's columns and D in place; no square roots, one division a column.
  double inverse[6];
  for (int j = 0; j < 6; ++j) {
    double* const column = a + 6 * j;
    const double pivot = column[j];
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return false;
    inverse[j] = 1.0 / pivot;
    for (int k = j + 1; k < 6; ++k) {
      const double factor = column[k] * inverse[j];
      for (int i = k; i < 6; ++i) a[6 * k + i] -= factor * column[i];
    }
  }
  // Columns hold L D.
  for (int i = 0; i < 6; ++i) x[i] = b[i];
  for (int j = 0; j < 6; ++j) {
    const double y = x[j] * inverse[j];
    for (int i = j + 1; i < 6; ++i) x[i] -= a[6 * j + i] * y;
  }
  for (int j = 5; j >= 0; --j) {
    double sum = x[j];
    for (int i = j + 1; i < 6; ++i) sum -= a[6 * j + i] * x[i];
    x[j] = sum * inverse[j];
  }
  return true;
}

}  // namespace plumb
