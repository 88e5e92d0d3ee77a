#version 450
// out[i] = 2 * in[i] with both arrays reached through addresses, for the tests of gpu/.
//
// Push  addresses of in and out, n     Dispatch  ceil(n / 8)
#extension GL_EXT_buffer_reference : require
layout(local_size_x = 8) in;

layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer In { float data[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) writeonly buffer Out { float data[]; };
layout(push_constant) uniform Push { In source; Out target; uint n; } p;

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= p.n) return;
  p.target.data[i] = 2.0 * p.source.data[i];
}
