#version 450
// out[i] = scale * in[i] + kOffset, for the tests of gpu/.
//
// Bindings   0 in   1 out        Push  n, scale       Spec  0 workgroup size   1 kOffset
// Dispatch   ceil(n / workgroup size)
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const float kOffset = 0.0;

layout(std430, binding = 0) readonly buffer In { float in_data[]; };
layout(std430, binding = 1) writeonly buffer Out { float out_data[]; };
layout(push_constant) uniform Push { uint n; float scale; } p;

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= p.n) return;
  out_data[i] = p.scale * in_data[i] + kOffset;
}
