#version 450
// Convolution as implicit GEMM with tiles in shared memory (family gpu: portable, fp32).
//
// out = relu?(bias + sum over taps and inputs of weight * prologue(in)) + residual + upsampled,
// prologue(x) = max(0, scale * x + shift). Outside the image counts as zero. The inputs of a tap are
// the channels of `in`, then those of `extra`. A workgroup makes 64 pixels x 8 * kOutPerThread
// channels; a thread makes 8 pixels x kOutPerThread channels.
//
// Layout      planar [channel][row][column]
// Bindings    0 constants: weights [tap and input, padded to 16][out, padded to the tile], bias [same],
//             scale [kIn], shift [kIn]   1 in   2 extra   3 residual   4 upsampled (half size)   5 out
// Push        height and width of input and output
// Spec        0 kShape: 0 1x1, 1 3x3, 2 cross of 17, 3 7x7 with stride 2; others below
// Dispatch    x ceil(pixels / 64), y ceil(kOut / tile)
// Iterations  (taps * inputs / 16 + 1) * 64 per invocation
// Reference   src/plumb/nn/reference/layer_reference.h     Test  tests/nn/gpu_kernels_test.cc
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kShape = 0u;
layout(constant_id = 1) const uint kIn = 32u;
layout(constant_id = 2) const uint kExtra = 0u;
layout(constant_id = 3) const uint kOut = 32u;
layout(constant_id = 4) const uint kOutPerThread = 4u;
layout(constant_id = 5) const bool kPrologue = false;
layout(constant_id = 6) const bool kRelu = false;
layout(constant_id = 7) const bool kResidual = false;
layout(constant_id = 8) const bool kUpsampled = false;

layout(std430, binding = 0) readonly buffer Constants { float constants[]; };
layout(std430, binding = 1) readonly buffer In { float in_data[]; };
layout(std430, binding = 2) readonly buffer Extra { float extra_data[]; };
layout(std430, binding = 3) readonly buffer Residual { float residual_data[]; };
layout(std430, binding = 4) readonly buffer Low { float low_data[]; };
layout(std430, binding = 5) writeonly buffer Out { float out_data[]; };
layout(push_constant) uniform Push { int in_height; int in_width; int out_height; int out_width; } p;

const uint kTaps = kShape == 0u ? 1u : (kShape == 1u ? 9u : (kShape == 2u ? 17u : 49u));
const int kStride = kShape == 3u ? 2 : 1;
const uint kInputs = kIn + kExtra;
const uint kK = kTaps * kInputs;
const uint kSteps = (kK + 15u) / 16u;
const uint kTile = 8u * kOutPerThread;
const uint kOutPadded = (kOut + kTile - 1u) / kTile * kTile;
const uint kBias = kSteps * 16u * kOutPadded;
const uint kScale = kBias + kOutPadded;

shared float pixels[16 * 64];
shared float weights[16 * 64];

// (row, column) of a tap, as listed by TapOffsets() of nn/layer_plan.h.
ivec2 TapOffset(int t) {
  if (kShape == 0u) return ivec2(0);
  if (kShape == 3u) return ivec2(t / 7 - 3, t % 7 - 3);
  if (t < 9) return ivec2(t / 3 - 1, t % 3 - 1);
  const int i = (t - 9) % 4;
  const int offset = i < 2 ? i - 3 : i;
  return t < 13 ? ivec2(offset, 0) : ivec2(0, offset);
}

float Input(uint k, ivec2 center) {
  if (k >= kK) return 0.0;
  const uint channel = k % kInputs;
  const ivec2 at = center + TapOffset(int(k / kInputs));
  if (at.x < 0 || at.x >= p.in_height || at.y < 0 || at.y >= p.in_width) return 0.0;
  const uint pixel = uint(at.x * p.in_width + at.y), plane = uint(p.in_height * p.in_width);
  if (channel >= kIn) return extra_data[(channel - kIn) * plane + pixel];
  const float value = in_data[channel * plane + pixel];
  if (!kPrologue) return value;
  return max(constants[kScale + channel] * value + constants[kScale + kIn + channel], 0.0);
}

void main() {
  const uint thread = gl_LocalInvocationID.x;
  const uint num_pixels = uint(p.out_height * p.out_width);
  const uint first_pixel = gl_WorkGroupID.x * 64u, first_out = gl_WorkGroupID.y * kTile;
  // The pixel that this thread loads; what is loaded behind the last one is not used.
  const int load_pixel = int(first_pixel + thread);
  const ivec2 center = kStride * ivec2(load_pixel / p.out_width, load_pixel % p.out_width);

  const uint pixel_lane = thread % 8u, out_lane = thread / 8u;
  float acc[8 * kOutPerThread];
  [[unroll]] for (uint i = 0u; i < 8u * kOutPerThread; ++i) acc[i] = 0.0;
  for (uint s = 0u; s < kSteps; ++s) {
    for (uint r = 0u; r < 16u; ++r) {
      const uint k = s * 16u + r;
      pixels[r * 64u + thread] = Input(k, center);
      if (thread < kTile) weights[r * 64u + thread] = constants[k * kOutPadded + first_out + thread];
    }
    barrier();
    for (uint r = 0u; r < 16u; ++r) {
      float x[8];
      [[unroll]] for (uint i = 0u; i < 8u; ++i) x[i] = pixels[r * 64u + pixel_lane + 8u * i];
      [[unroll]] for (uint j = 0u; j < kOutPerThread; ++j) {
        const float w = weights[r * 64u + out_lane + 8u * j];
        [[unroll]] for (uint i = 0u; i < 8u; ++i) acc[8u * j + i] += w * x[i];
      }
    }
    barrier();
  }

  [[unroll]] for (uint j = 0u; j < kOutPerThread; ++j) {
    const uint o = first_out + out_lane + 8u * j;
    if (o >= kOut) continue;
    const float bias = constants[kBias + o];
    [[unroll]] for (uint i = 0u; i < 8u; ++i) {
      const uint pixel = first_pixel + pixel_lane + 8u * i;
      if (pixel >= num_pixels) continue;
      float value = acc[8u * j + i] + bias;
      if (kRelu) value = max(value, 0.0);
      if (kResidual) value += residual_data[o * num_pixels + pixel];
      if (kUpsampled) {
        const uint width = uint(p.out_width);
        const uint low = pixel / width / 2u * (width / 2u) + pixel % width / 2u;
        value += low_data[o * (num_pixels / 4u) + low];
      }
      out_data[o * num_pixels + pixel] = value;
    }
  }
}
