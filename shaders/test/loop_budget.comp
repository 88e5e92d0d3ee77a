#version 450
// Counts the iterations that two nested loops really make, for the tests of gpu/.
//
// Bindings   0 limits: {outer, inner}   1 out: {iterations}   Dispatch  1 workgroup
layout(local_size_x = 1) in;

layout(std430, binding = 0) readonly buffer Limits { uint limits[]; };
layout(std430, binding = 1) writeonly buffer Out { uint out_data[]; };

void main() {
  const uint outer = limits[0];
  const uint inner = limits[1];
  uint count = 0;
  for (uint i = 0; i < outer; ++i) {
    for (uint j = 0; j < inner; ++j) ++count;
  }
  out_data[0] = count;
}
