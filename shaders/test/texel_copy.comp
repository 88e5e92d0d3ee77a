#version 450
// out[i] = texel i of an RGBA32F texel buffer, for the tests of gpu/.
//
// Bindings   0 in (texels)   1 out (vec4)     Push  n     Dispatch  ceil(n / 8)
layout(local_size_x = 8) in;

layout(binding = 0) uniform samplerBuffer in_texels;
layout(std430, binding = 1) writeonly buffer Out { vec4 out_data[]; };
layout(push_constant) uniform Push { uint n; } p;

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= p.n) return;
  out_data[i] = texelFetch(in_texels, int(i));
}
