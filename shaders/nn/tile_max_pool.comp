#version 450
// 2x2 maximum pooling, planar (family gpu).
//
// Bindings   0 in [channels][2 * height][2 * width]   1 out [channels][height][width]
// Push       number of outputs, width of the output     Dispatch  ceil(outputs / 64)
// Reference  src/plumb/nn/reference/layer_reference.h    Test  tests/nn/gpu_kernels_test.cc
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer In { float in_data[]; };
layout(std430, binding = 1) writeonly buffer Out { float out_data[]; };
layout(push_constant) uniform Push { uint count; uint width; } p;

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= p.count) return;
  // Planes have an even height, so rows can be counted through all of them.
  const uint at = i / p.width * 4u * p.width + i % p.width * 2u;
  const uint below = at + 2u * p.width;
  out_data[i] = max(max(in_data[at], in_data[at + 1u]), max(in_data[below], in_data[below + 1u]));
}
