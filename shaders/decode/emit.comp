#version 450
// End points of the chosen cells, best score first; of equal scores the first cell comes first.
//
//   centre = cell + sigmoid(off),  ends = centre -+ scale * dis,  px = px_per_cell * cells - 0.5
//
// Bindings   0 chosen scores, ended by -1 (vec4)   1 chosen cells   2 {number of lines}
//            3 the network's output planes [6][kRows][kWidth]: 2, 3 off logits; 4, 5 dis
//            4 out: {number of lines, padding}, DecodedLine[kMaxLines]
// Push       EmitParams
// Spec       0 workgroup size   1 kWidth   2 kRows   3 kMaxLines
// Dispatch   ceil(kMaxLines / wg)
// Loops      kMaxLines / 4
// Variants   PLUMB_CPU_SIMD=1 texel loads, for lavapipe; 0 storage loads
// Reference  src/plumb/features/vlse_decode_reference.cc    Test  tests/features/vlse_decoder_test.cc
#extension GL_GOOGLE_include_directive : require
#include "decode/decode_params.h"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint kWidth = 1;
layout(constant_id = 2) const uint kRows = 1;
layout(constant_id = 3) const uint kMaxLines = 1;

#if PLUMB_CPU_SIMD
layout(binding = 0) uniform samplerBuffer score_texels;
vec4 Scores(uint i) { return texelFetch(score_texels, int(i)); }
layout(binding = 3) uniform samplerBuffer plane_texels;
float Plane(uint plane, uint cell) {
  return texelFetch(plane_texels, int(plane * kWidth * kRows + cell)).x;
}
#else
layout(std430, binding = 0) readonly buffer ScoresIn { vec4 scores_in[]; };
vec4 Scores(uint i) { return scores_in[i]; }
layout(std430, binding = 3) readonly buffer Planes { float planes_in[]; };
float Plane(uint plane, uint cell) { return planes_in[plane * kWidth * kRows + cell]; }
#endif
layout(std430, binding = 1) readonly buffer Cells { uint cells_in[]; };
layout(std430, binding = 2) readonly buffer Count { uint count_in[]; };
layout(std430, binding = 4) writeonly buffer Out {
  uint out_count;
  uint out_padding[7];
  DecodedLine out_lines[];
};
layout(push_constant) uniform Push { EmitParams p; };

float Sigmoid(float x) { return 1.0 / (1.0 + exp(-x)); }

// How many of four scores, the first at place `first`, come before `score` at place `self`.
uint NumBefore(vec4 scores, uint first, float score, uint self) {
  const uvec4 places = first + uvec4(0u, 1u, 2u, 3u);
  const vec4 better = vec4(greaterThan(scores, vec4(score)));
  const vec4 earlier = vec4(equal(scores, vec4(score))) * vec4(lessThan(places, uvec4(self)));
  return uint(dot(better + earlier, vec4(1.0)));
}

void main() {
  const uint self = gl_GlobalInvocationID.x;
  const uint count = min(count_in[0], kMaxLines);
  if (self == 0u) out_count = count;
  if (self >= count) return;

  const float score = Scores(self / 4u)[self % 4u];
  uint rank = 0u;
  for (uint i = 0u; 4u * i < count; ++i) rank += NumBefore(Scores(i), 4u * i, score, self);

  const uint cell = cells_in[self];
  const vec2 corner = vec2(float(cell % kWidth), float(cell / kWidth));
  const vec2 centre = corner + vec2(Sigmoid(Plane(2u, cell)), Sigmoid(Plane(3u, cell)));
  vec2 half_extent = p.displacement_scale * vec2(Plane(4u, cell), Plane(5u, cell));
  if (half_extent.x < 0.0 || (half_extent.x == 0.0 && half_extent.y < 0.0)) {
    half_extent = -half_extent;  // The network is free to name either end first.
  }
  const vec2 px_per_cell = vec2(p.px_per_cell_x, p.px_per_cell_y);
  const vec2 start = px_per_cell * (centre - half_extent) - 0.5;
  const vec2 end = px_per_cell * (centre + half_extent) - 0.5;
  out_lines[rank] = DecodedLine(start.x, start.y, end.x, end.y, score, cell);
}
