#version 450
// 3x3 convolution by Winograd's F(4x4, 3x3), whole in one kernel (family cpu-simd).
//
// out = relu?(bias or partial + sum over 9 taps and inputs of weight * in); outside the image counts
// as zero. Each lane owns 4 rows of a block of 8 columns, two tiles of 4x4: it transforms its inputs
// once, V = B^T d B, and for every output channel multiplies by the transformed weights U = G g G^T
// (made at load) and transforms back, Y = A^T [sum over inputs of U * V] A. That is 2.25 products per
// pixel and weight kernel instead of 9, and nothing of the transformed data leaves the kernel.
//
// Layout p8, method and weights as in p8_conv.comp
// One pipeline serves all layers: what they differ in is pushed and decides no branch and no loop bound
// alone, since the driver recompiles for values that do. More inputs than the registers near the core hold
// go through partial sums.
//
// Bindings    0 weights: [out][kRow] = [position / 4][input][position % 4], 36 positions, then bias
//             1 in p8     2 partial sum p8     3 out p8 with room for whole groups of 4 rows
// Dispatch    x ceil(ceil(height / 4) * blocks / 8), y divides the output channels
// Iterations  output channels / y
// Reference   src/plumb/nn/reference/layer_reference.h     Test  tests/nn/cpu_simd_kernels_test.cc
// Source      Lavin and Gray, "Fast Algorithms for Convolutional Neural Networks" (points 0, +-1, +-2)
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#ifdef WEIGHT_ADDRESS
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#endif

layout(local_size_x = 8) in;  // One subgroup.
layout(constant_id = 0) const uint kK = 16u;  // channels read of `in`

layout(binding = 0) uniform samplerBuffer weights;
layout(binding = 1) uniform samplerBuffer in_texels;
layout(binding = 2) uniform samplerBuffer partial_texels;
layout(scalar, binding = 3) writeonly buffer Out { dvec4 out_data[]; };
layout(push_constant, scalar) uniform Push {
  int height;  // of the image
  int width;
  int in_first;  // channel of `in`
  int in_total;  // channels that `in` has
  uint out_channels;
  float floor;        // 0 for ReLU, else the lowest float
  int partial_start;  // 0, or far outside of the buffer for no partial sum
#ifdef WEIGHT_ADDRESS
  int unused;
  uint64_t weights;
#endif
} p;
#include "p8_weights.glsl"

const uint kRow = (36u * kK + 1u + 31u) / 32u * 32u;
const int kOutside = 0x3fff0000;  // Beyond every buffer: texelFetch returns 0 there.

int BlockTexel(int row, int column, int blocks) {
  const bool inside = row >= 0 && row < p.height && column >= 0 && column < blocks;
  return inside ? 2 * ((row * blocks + column) * p.in_total + p.in_first) : kOutside;
}

// Everything below is spelled out in single variables, since the driver's compiler is slow with arrays.
// The two components of a vec2 are the two tiles.

// B^T times a column of six, in place.
#define TRANSFORM_IN(d0, d1, d2, d3, d4, d5)                  \
  {                                                           \
    const vec2 e = d4 - 4.0 * d2, f = d3 - 4.0 * d1;          \
    const vec2 g = d4 - d2, h = 2.0 * (d3 - d1);              \
    d0 = 4.0 * d0 - 5.0 * d2 + d4;                            \
    d5 = 4.0 * d1 - 5.0 * d3 + d5;                            \
    d1 = e + f;                                               \
    d2 = e - f;                                               \
    d3 = g + h;                                               \
    d4 = g - h;                                               \
  }

// A^T times a column of six, in place: four results.
#define TRANSFORM_OUT(m0, m1, m2, m3, m4, m5)                 \
  {                                                           \
    const vec2 s = m1 + m2, d = m1 - m2;                      \
    const vec2 t = m3 + m4, e = m3 - m4;                      \
    m0 = m0 + s + t;                                          \
    m1 = d + 2.0 * e;                                         \
    m2 = s + 4.0 * t;                                         \
    m3 = d + 8.0 * e + m5;                                    \
  }

// One input row of channel k of both tiles, its columns transformed.
#define LOAD_ROW(r, v0, v1, v2, v3, v4, v5)                                       \
  vec2 v0, v1, v2, v3, v4, v5;                                                    \
  {                                                                               \
    const float a = texelFetch(in_texels, left##r + int(2u * k)).w;               \
    const vec4 b = texelFetch(in_texels, middle##r + int(2u * k));                \
    const vec4 c = texelFetch(in_texels, middle##r + int(2u * k + 1u));           \
    const float d = texelFetch(in_texels, right##r + int(2u * k)).x;              \
    v0 = vec2(a, b.w);                                                            \
    v1 = vec2(b.x, c.x);                                                          \
    v2 = vec2(b.y, c.y);                                                          \
    v3 = vec2(b.z, c.z);                                                          \
    v4 = vec2(b.w, c.w);                                                          \
    v5 = vec2(c.x, d);                                                            \
    TRANSFORM_IN(v0, v1, v2, v3, v4, v5)                                          \
  }

#define ROW_TEXELS(r)                                                             \
  const int left##r = BlockTexel(row + r - 1, column - 1, blocks) + 1;            \
  const int middle##r = BlockTexel(row + r - 1, column, blocks);                  \
  const int right##r = BlockTexel(row + r - 1, column + 1, blocks);

// Four transformed positions of channel k.
#define KEEP(g, v0, v1, v2, v3)                                 \
  x[2u * (g * kK + k)] = vec4(v0.x, v1.x, v2.x, v3.x);          \
  x[2u * (g * kK + k) + 1u] = vec4(v0.y, v1.y, v2.y, v3.y);

// Sums over inputs at four positions.
#define MULTIPLY(g, m0, m1, m2, m3)                                                         \
  vec2 m0, m1, m2, m3;                                                                      \
  {                                                                                         \
    vec4 a = vec4(0.0), b = vec4(0.0);                                                      \
    [[unroll]] for (uint k = 0u; k < kK; ++k) {                                             \
      const uint n = 4u * (g * kK + k);                                                     \
      if (n % 32u == 0u) w = FetchWeights(weight_row, n, lane);                             \
      const vec4 value =                                                                    \
          vec4(Weight(w, n), Weight(w, n + 1u), Weight(w, n + 2u), Weight(w, n + 3u));      \
      a = fma(value, x[n / 2u], a);                                                         \
      b = fma(value, x[n / 2u + 1u], b);                                                    \
    }                                                                                       \
    m0 = vec2(a.x, b.x);                                                                    \
    m1 = vec2(a.y, b.y);                                                                    \
    m2 = vec2(a.z, b.z);                                                                    \
    m3 = vec2(a.w, b.w);                                                                    \
  }

// One output row of both tiles.
#define STORE_ROW(m0, m1, m2, m3, m4, m5)                                                     \
  {                                                                                           \
    TRANSFORM_OUT(m0, m1, m2, m3, m4, m5)                                                     \
    vec4 a = vec4(m0.x, m1.x, m2.x, m3.x) + bias, b = vec4(m0.y, m1.y, m2.y, m3.y) + bias;    \
    a = max(a + texelFetch(partial_texels, p.partial_start + int(2u * to)), vec4(p.floor));      \
    b = max(b + texelFetch(partial_texels, p.partial_start + int(2u * to + 1u)), vec4(p.floor)); \
    a = mix(vec4(0.0), a, lessThan(ivec4(0, 1, 2, 3), ivec4(valid)));                         \
    b = mix(vec4(0.0), b, lessThan(ivec4(4, 5, 6, 7), ivec4(valid)));                         \
    out_data[to] =                                                                            \
        dvec4(packDouble2x32(floatBitsToUint(a.xy)), packDouble2x32(floatBitsToUint(a.zw)),   \
              packDouble2x32(floatBitsToUint(b.xy)), packDouble2x32(floatBitsToUint(b.zw)));  \
    to += next_row;                                                                           \
  }

void main() {
  const uint lane = gl_SubgroupInvocationID;
  const int tile = int(gl_WorkGroupID.x * 8u + lane);
  const int blocks = (p.width + 7) / 8;
  const int row = tile / blocks * 4, column = tile % blocks;

  // Transformed inputs: [position / 4][input][tile], four positions a vector.
  vec4 x[18u * kK];
  ROW_TEXELS(0) ROW_TEXELS(1) ROW_TEXELS(2)
  ROW_TEXELS(3) ROW_TEXELS(4) ROW_TEXELS(5)
  [[unroll]] for (uint k = 0u; k < kK; ++k) {
    LOAD_ROW(0, v00, v01, v02, v03, v04, v05)
    LOAD_ROW(1, v10, v11, v12, v13, v14, v15)
    LOAD_ROW(2, v20, v21, v22, v23, v24, v25)
    LOAD_ROW(3, v30, v31, v32, v33, v34, v35)
    LOAD_ROW(4, v40, v41, v42, v43, v44, v45)
    LOAD_ROW(5, v50, v51, v52, v53, v54, v55)
    TRANSFORM_IN(v00, v10, v20, v30, v40, v50)
    TRANSFORM_IN(v01, v11, v21, v31, v41, v51)
    TRANSFORM_IN(v02, v12, v22, v32, v42, v52)
    TRANSFORM_IN(v03, v13, v23, v33, v43, v53)
    TRANSFORM_IN(v04, v14, v24, v34, v44, v54)
    TRANSFORM_IN(v05, v15, v25, v35, v45, v55)
    KEEP(0u, v00, v01, v02, v03)
    KEEP(1u, v04, v05, v10, v11)
    KEEP(2u, v12, v13, v14, v15)
    KEEP(3u, v20, v21, v22, v23)
    KEEP(4u, v24, v25, v30, v31)
    KEEP(5u, v32, v33, v34, v35)
    KEEP(6u, v40, v41, v42, v43)
    KEEP(7u, v44, v45, v50, v51)
    KEEP(8u, v52, v53, v54, v55)
  }

  const uint count = p.out_channels / gl_NumWorkGroups.y;
  const uint first = gl_WorkGroupID.y * count;
  uint weight_row = first * kRow;
  uint target = uint(row * blocks + column) * p.out_channels + first;
  const uint next_row = uint(blocks) * p.out_channels;
  const int valid = p.width - 8 * column;  // Columns; the padding behind them stays zero.
  [[dont_unroll]] for (uint o = 0u; o < count; ++o) {
    vec4 w;
    MULTIPLY(0u, m00, m01, m02, m03)
    MULTIPLY(1u, m04, m05, m10, m11)
    MULTIPLY(2u, m12, m13, m14, m15)
    MULTIPLY(3u, m20, m21, m22, m23)
    MULTIPLY(4u, m24, m25, m30, m31)
    MULTIPLY(5u, m32, m33, m34, m35)
    MULTIPLY(6u, m40, m41, m42, m43)
    MULTIPLY(7u, m44, m45, m50, m51)
    MULTIPLY(8u, m52, m53, m54, m55)
    if (36u * kK % 32u == 0u) w = FetchWeights(weight_row, 36u * kK, lane);
    const vec4 bias = vec4(Weight(w, 36u * kK));

    TRANSFORM_OUT(m00, m10, m20, m30, m40, m50)
    TRANSFORM_OUT(m01, m11, m21, m31, m41, m51)
    TRANSFORM_OUT(m02, m12, m22, m32, m42, m52)
    TRANSFORM_OUT(m03, m13, m23, m33, m43, m53)
    TRANSFORM_OUT(m04, m14, m24, m34, m44, m54)
    TRANSFORM_OUT(m05, m15, m25, m35, m45, m55)
    uint to = target;
    STORE_ROW(m00, m01, m02, m03, m04, m05)
    STORE_ROW(m10, m11, m12, m13, m14, m15)
    STORE_ROW(m20, m21, m22, m23, m24, m25)
    STORE_ROW(m30, m31, m32, m33, m34, m35)
    weight_row += kRow;
    ++target;
  }
}
