#version 450
// Convolution, stride 1, for Vulkan drivers that run on the CPU with 8 lanes (family cpu-simd).
//
// out = relu?(bias + sum over taps and inputs of weight * prologue(in)) + residual + upsampled,
// prologue(x) = max(0, scale * x + shift). Taps by SHAPE: 0 1x1, 1 3x3, 2 cross of 17 (3x3, 7x1 and
// 1x7 joined). Pixels outside the image count as zero.
//
// Every lane owns the 8 pixels of one block for all output channels: their inputs are loaded once
// and stay in registers (in practice on the stack, where they are operands of plain vector
// instructions), the loop runs over output channels, and each weight reaches the lanes by a shuffle
// with a constant index out of a texel per lane. On these drivers this is the fast way to read:
// loads from storage buffers and dynamically indexed arrays run lane by lane.
//
// Layout p8   [row][block of 8 columns][channel][8] fp32, rows padded with zeros to whole blocks,
//             and buffers to whole groups of 8 blocks
// Bindings    0 weights: [out][kRow] with taps fastest, then bias, then zeros up to a multiple of 32;
//             then scale and shift, each padded to a multiple of 32
//             1 in, 2 extra in (1x1), 3 residual or partial sum, 4 upsampled (half size), all p8
//             5 out, p8 or planar [channel][row][column] (then width % 8 == 0)
// Push        height and width of the image; address of the weights (variants _address)
// Dispatch    x ceil(rows * blocks / 8), y divides kOut
// Iterations  kOut / y per invocation
// Reference   src/plumb/nn/reference/layer_reference.h     Test  tests/nn/cpu_simd_kernels_test.cc
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
layout(constant_id = 0) const uint kIn = 32u;        // channels read of `in`
layout(constant_id = 1) const uint kInFirst = 0u;    // the first of them
layout(constant_id = 2) const uint kInTotal = 32u;   // channels that `in` has
layout(constant_id = 3) const uint kExtra = 0u;      // the same for `extra`
layout(constant_id = 4) const uint kExtraFirst = 0u;
layout(constant_id = 5) const uint kExtraTotal = 0u;
layout(constant_id = 6) const uint kOut = 32u;
layout(constant_id = 7) const bool kPrologue = false;
layout(constant_id = 8) const bool kRelu = false;
layout(constant_id = 9) const uint kAdd = 0u;  // binding 3: 0 unused, 1 after ReLU, 2 before
layout(constant_id = 10) const bool kUpsampled = false;
layout(constant_id = 11) const bool kPlanarOut = false;

layout(binding = 0) uniform samplerBuffer weights;
layout(binding = 1) uniform samplerBuffer in_texels;
layout(binding = 2) uniform samplerBuffer extra_texels;
layout(binding = 3) uniform samplerBuffer add_texels;
layout(binding = 4) uniform samplerBuffer low_texels;
layout(scalar, binding = 5) writeonly buffer Out { dvec4 out_data[]; };
#ifdef WEIGHT_ADDRESS
layout(push_constant, scalar) uniform Push { int height; int width; uint64_t weights; } p;
#else
layout(push_constant, scalar) uniform Push { int height; int width; } p;
#endif
#include "p8_weights.glsl"

#if SHAPE == 0
const uint kTaps = 1u, kSpan = 2u;
#elif SHAPE == 1
const uint kTaps = 9u, kSpan = 18u;  // rows -1, 0, 1
#else
const uint kTaps = 17u, kSpan = 34u;  // rows -1, 0, 1, then -3, -2, 2, 3 without neighbours
#endif
const uint kK = kIn + kExtra;
const uint kRow = (kTaps * kK + 1u + 31u) / 32u * 32u;
const int kOutside = 0x3fff0000;  // Beyond every buffer: texelFetch returns 0 there.

// Texel of channel kInFirst of a block; `blocks` are in a row.
int BlockTexel(int row, int column, int blocks) {
  const bool inside = row >= 0 && row < p.height && column >= 0 && column < blocks;
  return inside ? 2 * ((row * blocks + column) * int(kInTotal) + int(kInFirst)) : kOutside;
}

// x holds windows of 8 pixels at every tap, two vectors each, so that no pixel is addressed alone: few
// variables keep the driver's compiler fast, and a pixel in several windows is one register after it.
#define SET(at, first, second) \
  x[at] = first;               \
  x[(at) + 1u] = second;

// Row `dy` of every channel with `reach` columns on both sides: 2 * reach + 1 windows from `start` on.
#define LOAD_ROW(dy, start, reach)                                     \
  {                                                                    \
    const int left = BlockTexel(row + dy, column - 1, blocks);         \
    const int middle = BlockTexel(row + dy, column, blocks);           \
    const int right = BlockTexel(row + dy, column + 1, blocks);        \
    [[unroll]] for (uint k = 0u; k < kK; ++k) {                        \
      const uint at = kSpan * k + start;                               \
      const vec4 a = texelFetch(in_texels, left + int(2u * k + 1u));   \
      const vec4 b = texelFetch(in_texels, middle + int(2u * k));      \
      const vec4 c = texelFetch(in_texels, middle + int(2u * k + 1u)); \
      const vec4 d = texelFetch(in_texels, right + int(2u * k));       \
      if (reach == 3u) {                                               \
        SET(at, vec4(a.yzw, b.x), vec4(b.yzw, c.x))                    \
        SET(at + 2u, vec4(a.zw, b.xy), vec4(b.zw, c.xy))               \
        SET(at + 10u, vec4(b.zw, c.xy), vec4(c.zw, d.xy))              \
        SET(at + 12u, vec4(b.w, c.xyz), vec4(c.w, d.xyz))              \
      }                                                                \
      SET(at + 2u * reach - 2u, vec4(a.w, b.xyz), vec4(b.w, c.xyz))    \
      SET(at + 2u * reach, b, c)                                       \
      SET(at + 2u * reach + 2u, vec4(b.yzw, c.x), vec4(c.yzw, d.x))    \
    }                                                                  \
  }

// The block's own 8 columns of row `dy`.
#define LOAD_BLOCK(dy, start)                                             \
  {                                                                       \
    const int middle = BlockTexel(row + dy, column, blocks);              \
    [[unroll]] for (uint k = 0u; k < kK; ++k) {                           \
      SET(kSpan * k + start, texelFetch(in_texels, middle + int(2u * k)), \
          texelFetch(in_texels, middle + int(2u * k + 1u)))               \
    }                                                                     \
  }

// Adds tap t of channel k, whose window lies at `base` of the channel's span.
#define TAP(t, base)                                          \
  {                                                           \
    const uint n = k * kTaps + t;                             \
    if (n % 32u == 0u) w = FetchWeights(weight_row, n, lane); \
    const vec4 value = vec4(Weight(w, n));                    \
    a = fma(value, x[kSpan * k + base], a);                   \
    b = fma(value, x[kSpan * k + base + 1u], b);              \
  }

void main() {
  const uint lane = gl_SubgroupInvocationID;
  const uint block = gl_WorkGroupID.x * 8u + lane;
  const int blocks = (p.width + 7) / 8;
  const int row = int(block) / blocks, column = int(block) % blocks;

  vec4 x[kK * kSpan];
#if SHAPE == 0
  const int own = int(2u * (block * kInTotal + kInFirst));
  [[unroll]] for (uint k = 0u; k < kIn; ++k) {
    SET(2u * k, texelFetch(in_texels, own + int(2u * k)),
        texelFetch(in_texels, own + int(2u * k + 1u)))
  }
  if (kPrologue) {
    const uint scales = kOut * kRow / 4u, shifts = scales + (kIn + 31u) / 32u * 8u;
    vec4 scale, shift;
    [[unroll]] for (uint k = 0u; k < kIn; ++k) {
      if (k % 32u == 0u) {
        scale = texelFetch(weights, int(scales + k / 4u + lane));
        shift = texelFetch(weights, int(shifts + k / 4u + lane));
      }
      const vec4 s = vec4(subgroupShuffle(scale[k % 4u], k % 32u / 4u));
      const vec4 t = vec4(subgroupShuffle(shift[k % 4u], k % 32u / 4u));
      x[2u * k] = max(fma(s, x[2u * k], t), vec4(0.0));
      x[2u * k + 1u] = max(fma(s, x[2u * k + 1u], t), vec4(0.0));
    }
  }
  const int own_extra = int(2u * (block * kExtraTotal + kExtraFirst));
  [[unroll]] for (uint k = 0u; k < kExtra; ++k) {
    SET(2u * (kIn + k), texelFetch(extra_texels, own_extra + int(2u * k)),
        texelFetch(extra_texels, own_extra + int(2u * k + 1u)))
  }
#else
#if SHAPE == 1
  LOAD_ROW(-1, 0u, 1u)
  LOAD_ROW(0, 6u, 1u)
  LOAD_ROW(1, 12u, 1u)
#else
  LOAD_ROW(-1, 0u, 1u)
  LOAD_ROW(0, 6u, 3u)
  LOAD_ROW(1, 20u, 1u)
  LOAD_BLOCK(-3, 26u)
  LOAD_BLOCK(-2, 28u)
  LOAD_BLOCK(2, 30u)
  LOAD_BLOCK(3, 32u)
#endif
#endif

  // Splitting over workgroups in y keeps every thread busy on small planes.
  const uint count = kOut / gl_NumWorkGroups.y;
  const uint first = gl_WorkGroupID.y * count;
  const uint plane = uint(p.height * blocks);
  uint weight_row = first * kRow;
  uint target = kPlanarOut ? first * plane + block : block * kOut + first;
  int add = int(2u * (block * kOut + first));
  // Half-size neighbour: the block's 8 pixels lie over 4 pixels, one texel.
  const int low_blocks = (p.width / 2 + 7) / 8;
  int low = 2 * ((row / 2 * low_blocks + column / 2) * int(kOut) + int(first)) + column % 2;
  const int valid = p.width - 8 * column;
  [[dont_unroll]] for (uint o = 0u; o < count; ++o) {
    vec4 a = vec4(0.0), b = vec4(0.0);
    if (kAdd == 2u) {
      a = texelFetch(add_texels, add);
      b = texelFetch(add_texels, add + 1);
    }
    vec4 w;
    [[unroll]] for (uint k = 0u; k < kK; ++k) {
#if SHAPE == 0
      TAP(0u, 0u)
#elif SHAPE == 1
      TAP(0u, 0u) TAP(1u, 2u) TAP(2u, 4u)
      TAP(3u, 6u) TAP(4u, 8u) TAP(5u, 10u)
      TAP(6u, 12u) TAP(7u, 14u) TAP(8u, 16u)
#else
      TAP(0u, 0u) TAP(1u, 2u) TAP(2u, 4u)
      TAP(3u, 10u) TAP(4u, 12u) TAP(5u, 14u)
      TAP(6u, 20u) TAP(7u, 22u) TAP(8u, 24u)
      TAP(9u, 26u) TAP(10u, 28u) TAP(11u, 30u) TAP(12u, 32u)
      TAP(13u, 6u) TAP(14u, 8u) TAP(15u, 16u) TAP(16u, 18u)
#endif
    }
    if (kK * kTaps % 32u == 0u) w = FetchWeights(weight_row, kK * kTaps, lane);
    const vec4 bias = vec4(Weight(w, kK * kTaps));
    a += bias;
    b += bias;
    if (kRelu) {
      a = max(a, vec4(0.0));
      b = max(b, vec4(0.0));
    }
    if (kAdd == 1u) {
      a += texelFetch(add_texels, add);
      b += texelFetch(add_texels, add + 1);
    }
    if (kUpsampled) {
      const vec4 c = texelFetch(low_texels, low);
      a += c.xxyy;
      b += c.zzww;
    }
    // The padding stays zero.
    a = mix(vec4(0.0), a, lessThan(ivec4(0, 1, 2, 3), ivec4(valid)));
    b = mix(vec4(0.0), b, lessThan(ivec4(4, 5, 6, 7), ivec4(valid)));
    out_data[target] =
        dvec4(packDouble2x32(floatBitsToUint(a.xy)), packDouble2x32(floatBitsToUint(a.zw)),
              packDouble2x32(floatBitsToUint(b.xy)), packDouble2x32(floatBitsToUint(b.zw)));
    weight_row += kRow;
    target += kPlanarOut ? plane : 1u;
    add += 2;
    low += 2;
  }
}
