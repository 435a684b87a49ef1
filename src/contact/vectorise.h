#pragma once

/// A hot loop (contact pairs, terms of a series), compiled for the vector widths of x86-64's levels and
/// chosen when the program starts: the same machine takes the same code in every run.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define FRETWAVE_VECTORISE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
/// Of registers of 64 bytes: to be called only where the machine supports x86-64-v4.
#define FRETWAVE_WIDE __attribute__((target("arch=x86-64-v4,prefer-vector-width=512")))
/// Whether functions so marked run in registers of 32 bytes at least ("x86-64-v3"), or of 64 ("x86-64-v4").
#define FRETWAVE_SUPPORTS(level) bool(__builtin_cpu_supports(level))
#else
#define FRETWAVE_VECTORISE
#define FRETWAVE_WIDE
#define FRETWAVE_SUPPORTS(level) false
#endif
#define FRETWAVE_INLINE __attribute__((always_inline)) inline
