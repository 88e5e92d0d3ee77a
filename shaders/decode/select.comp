#version 450
// The kMaxLines best cells, in order of their index; of equal scores the first cells win.
//
// One workgroup. If there are more candidates than kMaxLines, the score of the last one that gets
// in is found bit by bit: positive floats sort like their bits, so 30 counts over all cells fix it.
// Then every invocation copies the chosen cells of its own stretch; a scan over the invocations
// gives the places, which makes the result independent of timing.
//
// Tensors    in: score of each cell, negative if it is no candidate, [4 * kTexels]
// Bindings   0 in   1 out: scores [kMaxLines + 4], ended by four -1   2 out: cells [kMaxLines]
//            3 out: {number of lines}
// Spec       0 workgroup size <= 256   1 kTexels   2 kMaxLines
// Dispatch   1 workgroup
// Loops      31 * kTexels / workgroup size + 3 * workgroup size per invocation (limit: 60 000)
// Variants   PLUMB_CPU_SIMD=1 texel loads, for lavapipe; 0 storage loads
// Reference  src/plumb/features/vlse_decode_reference.cc    Test  tests/features/vlse_decoder_test.cc
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint kTexels = 1;
layout(constant_id = 2) const uint kMaxLines = 1;
const uint kMaxInvocations = 256;
const uint kOneBits = 0x3F800000u;  // 1.0f, no score is larger

#if PLUMB_CPU_SIMD
layout(binding = 0) uniform samplerBuffer in_texels;
vec4 Load(uint i) { return texelFetch(in_texels, int(i)); }
#else
layout(std430, binding = 0) readonly buffer In { vec4 in_data[]; };
vec4 Load(uint i) { return in_data[i]; }
#endif
layout(std430, binding = 1) writeonly buffer Scores { float out_scores[]; };
layout(std430, binding = 2) writeonly buffer Cells { uint out_cells[]; };
layout(std430, binding = 3) writeonly buffer Count { uint out_count[]; };

shared uint pass_totals[32];
shared uvec2 chunk_counts[kMaxInvocations];  // (above, equal) of each invocation's stretch

float CountInTexel(vec4 scores, float least) { return dot(step(vec4(least), scores), vec4(1.0)); }

// Number of cells with at least this score, over the whole workgroup.
uint CountAtLeast(float least, uint pass) {
  float count = 0.0;
  for (uint i = gl_LocalInvocationID.x; i < kTexels; i += gl_WorkGroupSize.x) {
    count += CountInTexel(Load(i), least);
  }
  atomicAdd(pass_totals[pass], uint(count));
  barrier();
  return pass_totals[pass];
}

void main() {
  const uint self = gl_LocalInvocationID.x;
  if (self < 32u) pass_totals[self] = 0u;
  barrier();

  // The score to reach: cells above it get in, cells equal to it while there is room.
  float cut = -0.5;
  if (CountAtLeast(0.0, 31u) > kMaxLines) {
    uint bits = 0u;
    for (uint bit = 0u; bit < 30u; ++bit) {
      const uint next = bits | (0x20000000u >> bit);
      // Above 1.0 nothing counts, and beyond infinity the bits are no number.
      const float least = uintBitsToFloat(min(next, kOneBits + 1u));
      if (CountAtLeast(least, bit) >= kMaxLines) bits = next;
    }
    cut = uintBitsToFloat(bits);
  }

  const uint stretch = (kTexels + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
  const uint begin = min(self * stretch, kTexels), end = min(begin + stretch, kTexels);
  uvec2 counts = uvec2(0u);
  for (uint i = begin; i < end; ++i) {
    const vec4 scores = Load(i);
    counts.x += uint(dot(vec4(greaterThan(scores, vec4(cut))), vec4(1.0)));
    counts.y += uint(dot(vec4(equal(scores, vec4(cut))), vec4(1.0)));
  }
  chunk_counts[self] = counts;
  barrier();
  uvec2 before = uvec2(0u), total = uvec2(0u);
  for (uint i = 0u; i < gl_WorkGroupSize.x; ++i) {
    const uvec2 other = chunk_counts[i];
    if (i < self) before += other;
    total += other;
  }

  const uint room_for_equal = kMaxLines - total.x;
  for (uint i = begin; i < end; ++i) {
    const vec4 scores = Load(i);
    for (uint lane = 0u; lane < 4u; ++lane) {
      const float score = scores[lane];
      const bool is_above = score > cut;
      const bool is_in = is_above || (score == cut && before.y < room_for_equal);
      if (is_in) {
        const uint place = before.x + min(before.y, room_for_equal);
        out_scores[place] = score;
        out_cells[place] = 4u * i + lane;
      }
      before.x += is_above ? 1u : 0u;
      before.y += score == cut ? 1u : 0u;
    }
  }

  const uint count = total.x + min(total.y, room_for_equal);
  if (self < 4u) out_scores[count + self] = -1.0;
  if (self == 0u) out_count[0] = count;
}
