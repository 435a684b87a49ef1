#pragma once
#include "petsc.h"

namespace fretwave::solve {

inline VecHandle copy(Vec v) {
  VecHandle w = like(v);
  check(VecCopy(v, w));
  return w;
}

inline VecHandle zero_like(Vec v) {
  VecHandle w = like(v);
  check(VecSet(w, 0));
  return w;
}

inline double dot(Vec a, Vec b) {
  double sum;
  check(VecDot(a, b, &sum));
  return sum;
}

inline double norm(Vec v) {
  double length;
  check(VecNorm(v, NORM_2, &length));
  return length;
}

/// W v for diagonal weights W.
inline VecHandle weighted(Vec weights, Vec v) {
  VecHandle w = like(v);
  check(VecPointwiseMult(w, weights, v));
  return w;
}

inline double weighted_norm(Vec weights, Vec v) { return std::sqrt(dot(weighted(weights, v), v)); }

/// a + s b.
inline VecHandle moved(Vec a, double s, Vec b) {
  VecHandle c = copy(a);
  check(VecAXPY(c, s, b));
  return c;
}

}  // namespace fretwave::solve
