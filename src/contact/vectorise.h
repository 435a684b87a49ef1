#pragma once

/// One loop over contact pairs, compiled for the vector widths of x86-64's levels and chosen when the program
/// starts: the same machine takes the same code in every run.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define FRETWAVE_VECTORISE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
/// Of registers of 64 bytes: to be called only where `has_wide_registers()`.
#define FRETWAVE_WIDE __attribute__((target("arch=x86-64-v4,prefer-vector-width=512")))
#else
#define FRETWAVE_VECTORISE
#endif
/// Whether functions so marked run in registers of 32 bytes at least, and of 64 bytes.
inline bool has_registers() {
#ifdef FRETWAVE_WIDE
  return __builtin_cpu_supports("x86-64-v3");
#else
  return false;
#endif
}
inline bool has_wide_registers() {
#ifdef FRETWAVE_WIDE
  return __builtin_cpu_supports("x86-64-v4");
#else
  return false;
#endif
}
#define FRETWAVE_INLINE __attribute__((always_inline)) inline
