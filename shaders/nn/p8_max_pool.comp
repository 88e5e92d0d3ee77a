#version 450
// 2x2 maximum pooling in the layout p8 (family cpu-simd): a lane makes one block of 8 pixels.
//
// Bindings    0 in p8, twice the height and width of the output     1 out p8     Push  width
// Dispatch    x ceil(rows * blocks / 8), y divides kChannels     Iterations  kChannels / y
// Reference   src/plumb/nn/reference/layer_reference.h     Test  tests/nn/cpu_simd_kernels_test.cc
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kChannels = 16u;
layout(push_constant) uniform Push { uint width; } p;  // of the output

layout(binding = 0) uniform samplerBuffer in_texels;
layout(scalar, binding = 1) writeonly buffer Out { dvec4 out_data[]; };

// Maxima over pairs of columns of two texels.
vec4 Pairs(vec4 a, vec4 b) { return max(vec4(a.xz, b.xz), vec4(a.yw, b.yw)); }

void main() {
  const uint block = gl_WorkGroupID.x * 8u + gl_LocalInvocationID.x;
  const uint blocks = (p.width + 7u) / 8u, in_blocks = (2u * p.width + 7u) / 8u;
  const uint row = block / blocks, column = block % blocks;
  const uint count = kChannels / gl_NumWorkGroups.y;
  const uint first = gl_WorkGroupID.y * count;
  const uint valid = p.width - 8u * column;
  int upper = int(2u * ((2u * row * in_blocks + 2u * column) * kChannels + first));
  const int next_block = int(2u * kChannels), next_row = int(2u * in_blocks * kChannels);
  uint target = block * kChannels + first;
  [[dont_unroll]] for (uint c = 0u; c < count; ++c) {
    vec4 pooled[2];
    [[unroll]] for (int h = 0; h < 2; ++h) {
      const int t = upper + h * next_block;
      pooled[h] = max(Pairs(texelFetch(in_texels, t), texelFetch(in_texels, t + 1)),
                      Pairs(texelFetch(in_texels, t + next_row), texelFetch(in_texels, t + next_row + 1)));
    }
    // The padding stays zero; the second half may lie in the next row.
    [[unroll]] for (uint j = 0u; j < 4u; ++j) {
      pooled[0][j] = j < valid ? pooled[0][j] : 0.0;
      pooled[1][j] = 4u + j < valid ? pooled[1][j] : 0.0;
    }
    out_data[target] = dvec4(packDouble2x32(floatBitsToUint(pooled[0].xy)),
                             packDouble2x32(floatBitsToUint(pooled[0].zw)),
                             packDouble2x32(floatBitsToUint(pooled[1].xy)),
                             packDouble2x32(floatBitsToUint(pooled[1].zw)));
    upper += 2;
    ++target;
  }
}
