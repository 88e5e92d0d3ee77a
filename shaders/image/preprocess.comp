#version 450
// Camera image to network input: YUV to RGB, bilinear resize, normalisation.
//
//   out[c][y][x] = (rgb_c(s_x(x), s_y(y)) - mean_c) * gain_c,   s_x(x) = (x + 0.5) * scale_x - 0.5
//
// rgb(.,.) interpolates between the four nearest pixels, pixels beyond the border repeat it. YUV is
// BT.601, full range, each chroma sample serves its 2 x 2 pixels; RGB is clamped to 0..255 after
// the interpolation.
//
// Bindings   0 image planes (32-bit words, little endian)   1 out [3][out_height][out_width]
// Push       PreprocessParams
// Spec       0,1 workgroup size   2 format: gray, rgb, bgr, nv12, nv21, i420
// Dispatch   ceil(out_width / 2 / wg.x), ceil(out_height / wg.y); out_width is even; an invocation
//            makes two pixels of a row
// Variants   PLUMB_CPU_SIMD=1 texel loads and 64-bit stores, for lavapipe; 0 storage loads
// Reference  src/plumb/features/image_tensor_reference.cc
// Test       tests/features/image_preprocessor_test.cc
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#if PLUMB_CPU_SIMD
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#endif
#include "image/preprocess_params.h"

layout(local_size_x_id = 0, local_size_y_id = 1) in;
layout(constant_id = 2) const uint kFormat = 1;
const uint kGray8 = 0, kRgb8 = 1, kBgr8 = 2, kNv12 = 3, kNv21 = 4, kI420 = 5;

#if PLUMB_CPU_SIMD
layout(binding = 0) uniform usamplerBuffer image_words;
uint Word(uint i) { return texelFetch(image_words, int(i)).x; }
layout(std430, binding = 1) writeonly buffer Out { uint64_t out_pairs[]; };
void StorePair(uint i, vec2 pair) { out_pairs[i] = packUint2x32(floatBitsToUint(pair)); }
#else
layout(std430, binding = 0) readonly buffer Image { uint image_words[]; };
uint Word(uint i) { return image_words[i]; }
layout(std430, binding = 1) writeonly buffer Out { vec2 out_pairs[]; };
void StorePair(uint i, vec2 pair) { out_pairs[i] = pair; }
#endif
layout(push_constant) uniform Push { PreprocessParams p; };

// Four bytes that start at byte `shift_bits / 8` of the pair (low, high).
uint Funnel(uint low, uint high, uint shift_bits) {
  return (low >> shift_bits) | ((high << 1) << (31u - shift_bits));
}

float Byte(uint word, uint index) { return float((word >> (8u * index)) & 255u); }

// Four bytes at any address.
uint BytesAt(uint address) {
  const uint word = address / 4u;
  return Funnel(Word(word), Word(word + 1u), 8u * (address % 4u));
}

// Where a sample lies: the pixel at its left (above), the next one, and the next one's weight.
struct Tap {
  uint first, second;
  float weight;
};

Tap MakeTap(uint out_pos, float scale, uint size) {
  const float pos = clamp((float(out_pos) + 0.5) * scale - 0.5, 0.0, float(size - 1u));
  const uint first = uint(pos);
  return Tap(first, min(first + 1u, size - 1u), pos - float(first));
}

// Interpolates along a row of an interleaved three-channel plane. The pixel after the row's last
// one is read with weight 0; the buffer is padded for it.
vec3 PackedRow(uint y, Tap x) {
  const uint address = p.offset0 + y * p.stride0 + 3u * x.first;
  const uint word = address / 4u, shift = 8u * (address % 4u);
  const uint w1 = Word(word + 1u);
  const uint low = Funnel(Word(word), w1, shift);        // c0 c1 c2 | c0
  const uint high = Funnel(w1, Word(word + 2u), shift);  // c1 c2
  const vec3 a = vec3(Byte(low, 0u), Byte(low, 1u), Byte(low, 2u));
  const vec3 b = vec3(Byte(low, 3u), Byte(high, 0u), Byte(high, 1u));
  return a + x.weight * (b - a);
}

float LumaRow(uint y, Tap x) {
  const uint bytes = BytesAt(p.offset0 + y * p.stride0 + x.first);
  const float a = Byte(bytes, 0u);
  return a + x.weight * (Byte(bytes, 1u) - a);
}

// (U, V) along the row of chroma that belongs to row y of the image.
vec2 ChromaRow(uint y, Tap x) {
  const uint column = x.first / 2u;
  const bool moves = x.second / 2u != column;
  vec2 a, b;
  if (kFormat == kI420) {
    const uint u = BytesAt(p.offset1 + (y / 2u) * p.stride1 + column);
    const uint v = BytesAt(p.offset2 + (y / 2u) * p.stride2 + column);
    a = vec2(Byte(u, 0u), Byte(v, 0u));
    b = vec2(Byte(u, 1u), Byte(v, 1u));
  } else {
    const uint bytes = BytesAt(p.offset1 + (y / 2u) * p.stride1 + 2u * column);
    a = vec2(Byte(bytes, 0u), Byte(bytes, 1u));
    b = vec2(Byte(bytes, 2u), Byte(bytes, 3u));
    if (kFormat == kNv21) {
      a = a.yx;
      b = b.yx;
    }
  }
  return moves ? a + x.weight * (b - a) : a;
}

vec3 SampleRgb(Tap x, Tap y) {
  if (kFormat == kRgb8 || kFormat == kBgr8) {
    const vec3 a = PackedRow(y.first, x);
    const vec3 v = a + y.weight * (PackedRow(y.second, x) - a);
    return kFormat == kRgb8 ? v : v.bgr;
  }
  const float luma_a = LumaRow(y.first, x);
  const float luma = luma_a + y.weight * (LumaRow(y.second, x) - luma_a);
  if (kFormat == kGray8) return vec3(luma);

  const vec2 chroma_a = ChromaRow(y.first, x);
  const vec2 uv = chroma_a + y.weight * (ChromaRow(y.second, x) - chroma_a) - 128.0;
  const vec3 rgb =
      vec3(luma + 1.402 * uv.y, luma - 0.344136 * uv.x - 0.714136 * uv.y, luma + 1.772 * uv.x);
  return clamp(rgb, 0.0, 255.0);
}

void main() {
  const uvec2 pos = gl_GlobalInvocationID.xy;
  const uint pairs = p.out_width / 2u;
  if (pos.x >= pairs || pos.y >= p.out_height) return;

  const vec3 mean = vec3(p.mean_r, p.mean_g, p.mean_b);
  const vec3 gain = vec3(p.gain_r, p.gain_g, p.gain_b);
  const Tap y = MakeTap(pos.y, p.scale_y, p.in_height);
  const vec3 a = (SampleRgb(MakeTap(2u * pos.x, p.scale_x, p.in_width), y) - mean) * gain;
  const vec3 b = (SampleRgb(MakeTap(2u * pos.x + 1u, p.scale_x, p.in_width), y) - mean) * gain;

  const uint index = pos.y * pairs + pos.x;
  const uint plane = p.out_height * pairs;
  StorePair(index, vec2(a.r, b.r));
  StorePair(index + plane, vec2(a.g, b.g));
  StorePair(index + 2u * plane, vec2(a.b, b.b));
}
