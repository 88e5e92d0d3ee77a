// Function multiversioning for hot loops that the compiler vectorises.
#pragma once

// PLUMB_SIMD_CLONES before a function definition compiles it for the baseline, for AVX2 + FMA and
// for AVX-512; the loader picks one at start-up. Levels are named by what the processor can do: a
// model's name, such as arch=haswell, is chosen on that model only. It is empty where the tool
// chain cannot do it: other architectures, other compilers, and sanitizers (their runtime starts
// after the loader's choice). Clones may round differently, so results are reproducible per
// machine, not across machines.
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define PLUMB_SIMD_CLONES \
  __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define PLUMB_SIMD_CLONES
#endif
