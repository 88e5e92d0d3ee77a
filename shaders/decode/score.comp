#version 450
// Score of every cell being the midpoint of a line, with soft non-maximum suppression.
//
//   m = logit_1 - logit_0,  p = 1 / (1 + exp(-m)),  s = p * (m >= max of the 3 x 3 cells ? 1 : decay)
//   out = s >= threshold ? s : -1
//
// Tensors    in [2][kRows][4 * kRowTexels], four cells of a row per vec4; out [kRows][4 * kRowTexels]
// Bindings   0 in   1 out
// Push       ScoreParams
// Spec       0,1 workgroup size   2 kRowTexels   3 kRows
// Dispatch   ceil(kRowTexels / wg.x), ceil(kRows / wg.y)
// Variants   PLUMB_CPU_SIMD=1 texel loads and 64-bit stores, for lavapipe; 0 storage loads
// Reference  src/plumb/features/vlse_decode_reference.cc    Test  tests/features/vlse_decoder_test.cc
#extension GL_GOOGLE_include_directive : require
#if PLUMB_CPU_SIMD
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#endif
#include "decode/decode_params.h"

layout(local_size_x_id = 0, local_size_y_id = 1) in;
layout(constant_id = 2) const uint kRowTexels = 1;
layout(constant_id = 3) const uint kRows = 1;

#if PLUMB_CPU_SIMD
layout(binding = 0) uniform samplerBuffer in_texels;
vec4 Load(uint i) { return texelFetch(in_texels, int(i)); }
layout(std430, binding = 1) writeonly buffer Out { u64vec2 out_data[]; };
void Store(uint i, vec4 v) {
  out_data[i] = u64vec2(packUint2x32(floatBitsToUint(v.xy)), packUint2x32(floatBitsToUint(v.zw)));
}
#else
layout(std430, binding = 0) readonly buffer In { vec4 in_data[]; };
vec4 Load(uint i) { return in_data[i]; }
layout(std430, binding = 1) writeonly buffer Out { vec4 out_data[]; };
void Store(uint i, vec4 v) { out_data[i] = v; }
#endif
layout(push_constant) uniform Push { ScoreParams p; };

vec4 Margin(uint i) { return Load(i + kRows * kRowTexels) - Load(i); }

// Maxima over each cell of the row and its two neighbours; cells beyond the border do not count.
vec4 RowMaxima(uint column, uint row, vec4 own) {
  const uint i = row * kRowTexels + column;
  const float left = column > 0u ? Margin(i - min(column, 1u)).w : own.x;
  const float right = column + 1u < kRowTexels ? Margin(i + 1u).x : own.w;
  return max(own, max(vec4(left, own.xyz), vec4(own.yzw, right)));
}

void main() {
  const uint column = gl_GlobalInvocationID.x, row = gl_GlobalInvocationID.y;
  if (column >= kRowTexels || row >= kRows) return;
  // A row repeated at the border does not change the maximum.
  const uint above = row - min(row, 1u), below = min(row + 1u, kRows - 1u);

  const vec4 own = Margin(row * kRowTexels + column);
  vec4 best = RowMaxima(column, row, own);
  best = max(best, RowMaxima(column, above, Margin(above * kRowTexels + column)));
  best = max(best, RowMaxima(column, below, Margin(below * kRowTexels + column)));

  const vec4 probability = 1.0 / (1.0 + exp(-own));
  const vec4 score = probability * mix(vec4(p.nms_decay), vec4(1.0), greaterThanEqual(own, best));
  const bvec4 is_candidate = greaterThanEqual(score, vec4(p.score_threshold));
  Store(row * kRowTexels + column, mix(vec4(-1.0), score, is_candidate));
}
