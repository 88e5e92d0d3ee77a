#include "plumb/base/weighted_products.h"

#include <cstring>

#include "plumb/base/simd_clones.h"

namespace plumb {
namespace {

constexpr size_t kLanes = 8;

// Eight floats as one register, or two where there is none so wide.
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));

inline void Load(const float* p, Lanes* out) { std::memcpy(out, p, sizeof(*out)); }

inline float Sum(const Lanes& v) {
  return ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
}

/// Products of the unknowns 0 and 1: as many sums as sixteen registers hold beside their factors,
/// each a variable of its own, since arrays would stay in memory. `count` is a multiple of kLanes,
/// here and below.
PLUMB_SIMD_CLONES void FirstProducts(size_t count, const float* const* columns, const float* weight,
                                     float* row0, float* row1) {
  Lanes a0{}, a1{}, a2{}, a3{}, a4{}, a5{}, a6{}, b1{}, b2{}, b3{}, b4{}, b5{}, b6{};
  const float *p0 = columns[0], *p1 = columns[1], *p2 = columns[2], *p3 = columns[3];
  const float *p4 = columns[4], *p5 = columns[5], *p6 = columns[6];
  for (size_t k = 0; k < count; k += kLanes) {
    Lanes w, c, a, b;
    Load(weight + k, &w);
    Load(p0 + k, &a);
    Load(p1 + k, &b);
    const Lanes wa = w * a, wb = w * b;
    a0 += wa * a;
    a1 += wa * b;
    b1 += wb * b;
    Load(p2 + k, &c);
    a2 += wa * c;
    b2 += wb * c;
    Load(p3 + k, &c);
    a3 += wa * c;
    b3 += wb * c;
    Load(p4 + k, &c);
    a4 += wa * c;
    b4 += wb * c;
    Load(p5 + k, &c);
    a5 += wa * c;
    b5 += wb * c;
    Load(p6 + k, &c);
    a6 += wa * c;
    b6 += wb * c;
  }
  row0[0] += Sum(a0);
  row0[1] += Sum(a1);
  row0[2] += Sum(a2);
  row0[3] += Sum(a3);
  row0[4] += Sum(a4);
  row0[5] += Sum(a5);
  row0[6] += Sum(a6);
  row1[1] += Sum(b1);
  row1[2] += Sum(b2);
  row1[3] += Sum(b3);
  row1[4] += Sum(b4);
  row1[5] += Sum(b5);
  row1[6] += Sum(b6);
}

/// Products of the unknowns 2 to 5.
PLUMB_SIMD_CLONES void LastProducts(size_t count, const float* const* columns, const float* weight,
                                    float* row2, float* row3, float* row4, float* row5) {
  Lanes a2{}, a3{}, a4{}, a5{}, a6{}, b3{}, b4{}, b5{}, b6{}, c4{}, c5{}, c6{}, d5{}, d6{};
  const float *p2 = columns[2], *p3 = columns[3], *p4 = columns[4], *p5 = columns[5];
  const float* p6 = columns[6];
  for (size_t k = 0; k < count; k += kLanes) {
    Lanes w, x, wx, y;
    Load(weight + k, &w);
    Load(p2 + k, &x);
    wx = w * x;
    a2 += wx * x;
    Load(p3 + k, &y);
    a3 += wx * y;
    Load(p4 + k, &y);
    a4 += wx * y;
    Load(p5 + k, &y);
    a5 += wx * y;
    Load(p6 + k, &y);
    a6 += wx * y;
    Load(p3 + k, &x);
    wx = w * x;
    b3 += wx * x;
    Load(p4 + k, &y);
    b4 += wx * y;
    Load(p5 + k, &y);
    b5 += wx * y;
    Load(p6 + k, &y);
    b6 += wx * y;
    Load(p4 + k, &x);
    wx = w * x;
    c4 += wx * x;
    Load(p5 + k, &y);
    c5 += wx * y;
    Load(p6 + k, &y);
    c6 += wx * y;
    Load(p5 + k, &x);
    wx = w * x;
    d5 += wx * x;
    Load(p6 + k, &y);
    d6 += wx * y;
  }
  row2[2] += Sum(a2);
  row2[3] += Sum(a3);
  row2[4] += Sum(a4);
  row2[5] += Sum(a5);
  row2[6] += Sum(a6);
  row3[3] += Sum(b3);
  row3[4] += Sum(b4);
  row3[5] += Sum(b5);
  row3[6] += Sum(b6);
  row4[4] += Sum(c4);
  row4[5] += Sum(c5);
  row4[6] += Sum(c6);
  row5[5] += Sum(d5);
  row5[6] += Sum(d6);
}

void AddProducts(size_t count, const float* const* columns, const float* weight, float sums[6][7]) {
  FirstProducts(count, columns, weight, sums[0], sums[1]);
  LastProducts(count, columns, weight, sums[2], sums[3], sums[4], sums[5]);
}

}  // namespace

void SumWeightedProducts(size_t count, const LeastSquaresColumns& columns, const float* weight,
                         float sums[6][7]) {
  for (size_t i = 0; i < 6; ++i) {
    for (size_t j = i; j < 7; ++j) sums[i][j] = 0.0f;
  }
  const size_t whole = count / kLanes * kLanes;
  if (whole > 0) AddProducts(whole, columns.data(), weight, sums);
  if (whole == count) return;
  // The rest in a row of its own, filled up with weights of 0.
  float rest[8][kLanes] = {};
  const float* rest_columns[7];
  const size_t bytes = (count - whole) * sizeof(float);
  for (size_t i = 0; i < 7; ++i) {
    std::memcpy(rest[i], columns[i] + whole, bytes);
    rest_columns[i] = rest[i];
  }
  std::memcpy(rest[7], weight + whole, bytes);
  AddProducts(kLanes, rest_columns, rest[7], sums);
}

}  // namespace plumb
