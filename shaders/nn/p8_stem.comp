#version 450
// 7x7 convolution, stride 2, padding 3, of the planar image tensor, + ReLU (family cpu-simd).
//
// out = relu(bias + sum over 49 taps and 3 planes of weight * in); outside the image counts as zero.
// A lane owns 8 output pixels of a row, see p8_conv.comp for the method and the layout p8.
//
// Bindings    0 weights: [out][160]: 147 with column fastest, then row, then plane; bias; zeros
//             1 in: planar [3][kInHeight][kInWidth], kInWidth % 16 == 0
//             2 out: p8 [kInHeight / 2][kInWidth / 16][kOut][8]
// Dispatch    x ceil(rows * blocks / 8)     Iterations  kOut per invocation
// Reference   src/plumb/nn/reference/layer_reference.h     Test  tests/nn/cpu_simd_kernels_test.cc
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kOut = 16u;
layout(constant_id = 1) const uint kInHeight = 64u;
layout(constant_id = 2) const uint kInWidth = 64u;

layout(binding = 0) uniform samplerBuffer weights;
layout(binding = 1) uniform samplerBuffer in_texels;
layout(scalar, binding = 2) writeonly buffer Out { dvec4 out_data[]; };

const uint kRow = 160u;
const uint kSpan = 24u;  // Columns 16 * block - 4 .. + 19 of an input row, six texels; 21 are used.
const int kOutside = 0x3fff0000;

void main() {
  const uint lane = gl_SubgroupInvocationID;
  const uint block = gl_WorkGroupID.x * 8u + lane;
  const uint blocks = kInWidth / 16u;
  const int row = int(block / blocks), column = int(block % blocks);

  float x[21u * kSpan];
  [[unroll]] for (uint y = 0u; y < 7u; ++y) {
    const int in_row = 2 * row + int(y) - 3;
    const bool inside = in_row >= 0 && in_row < int(kInHeight);
    const int start = in_row * int(kInWidth / 4u) + 4 * column - 1;
    [[unroll]] for (uint i = 0u; i < 6u; ++i) {
      const bool edge = (i == 0u && column == 0) || (i == 5u && column == int(blocks) - 1);
      [[unroll]] for (uint c = 0u; c < 3u; ++c) {
        const int texel = inside && !edge ? start + int(i + c * (kInHeight * kInWidth / 4u)) : kOutside;
        const vec4 a = texelFetch(in_texels, texel);
        [[unroll]] for (uint j = 0u; j < 4u; ++j) x[(c * 7u + y) * kSpan + 4u * i + j] = a[j];
      }
    }
  }

  uint target = block * kOut;
  int weight = int(lane);
  [[dont_unroll]] for (uint o = 0u; o < kOut; ++o) {
    float acc[8];
    [[unroll]] for (uint j = 0u; j < 8u; ++j) acc[j] = 0.0;
    vec4 w;
    [[unroll]] for (uint r = 0u; r < 21u; ++r) {
      [[unroll]] for (uint t = 0u; t < 7u; ++t) {
        const uint n = r * 7u + t;
        if (n % 32u == 0u) w = texelFetch(weights, weight + int(n / 4u));
        const float value = subgroupShuffle(w[n % 4u], n % 32u / 4u);
        [[unroll]] for (uint j = 0u; j < 8u; ++j) {
          acc[j] = fma(value, x[r * kSpan + 1u + 2u * j + t], acc[j]);
        }
      }
    }
    const float bias = subgroupShuffle(w[147u % 4u], 147u % 32u / 4u);
    [[unroll]] for (uint j = 0u; j < 8u; ++j) acc[j] = max(acc[j] + bias, 0.0);
    out_data[target] = dvec4(packDouble2x32(floatBitsToUint(vec2(acc[0], acc[1]))),
                             packDouble2x32(floatBitsToUint(vec2(acc[2], acc[3]))),
                             packDouble2x32(floatBitsToUint(vec2(acc[4], acc[5]))),
                             packDouble2x32(floatBitsToUint(vec2(acc[6], acc[7]))));
    weight += int(kRow / 4u);
    ++target;
  }
}
