// Weights of one output channel, 32 at a time: one fetch puts four different ones on each of 8 lanes,
// a shuffle with a constant index spreads one of them. Two sources, see WeightSource in nn/ops/cpu_simd.h.
//
// The including kernel declares `uniform samplerBuffer weights` or, with WEIGHT_ADDRESS, a push
// constant `p.weights`, and passes literal or specialization constant positions to Weight().
#ifdef WEIGHT_ADDRESS
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Pair { uint64_t data; };
#endif

// Weights row_start + first .. + 31; both arguments are multiples of 32.
vec4 FetchWeights(uint row_start, uint first, uint lane) {
#ifdef WEIGHT_ADDRESS
  const uint64_t at = p.weights + uint64_t(row_start + first + 2u * lane) * 4ul;
  vec4 w;
  w.xy = uintBitsToFloat(unpackUint2x32(Pair(at).data));
  w.zw = uintBitsToFloat(unpackUint2x32(Pair(at + 64ul).data));
  return w;
#else
  return texelFetch(weights, int((row_start + first) / 4u + lane));
#endif
}

// Weight n % 32 of the last fetch, on all lanes.
float Weight(vec4 w, uint n) {
#ifdef WEIGHT_ADDRESS
  return subgroupShuffle(w[n % 32u / 16u * 2u + n % 2u], n % 16u / 2u);
#else
  return subgroupShuffle(w[n % 4u], n % 32u / 4u);
#endif
}
