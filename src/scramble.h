#pragma once
#include <cstdint>

#include "petsc.h"

namespace fretwave {

/// A number whose bits depend on all of x's (splitmix64, Steele et al. 2014).
inline std::uint64_t scrambled(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// A start for eigensolvers that is the same on any rank.
inline VecHandle scrambled_vector(PetscInt n) {
  VecHandle v = make_vector(PETSC_COMM_SELF, n);
  const WriteArray to(v);
  for (PetscInt i = 0; i < n; ++i) to[i] = double(scrambled(std::uint64_t(i)) >> 11) * 0x1p-53 - 0.5;
  return v;
}

}  // namespace fretwave
