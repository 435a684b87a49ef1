#pragma once
#include <vector>

#include "lapack.h"

namespace fretwave::hb {

/// Dense derivatives of the forces of pairs, each by the coefficients of its own motion, D (size x size), and
/// by its gap (size).
struct PairBlocks {
  std::vector<double> D, by_gap;
  int size = 0;
  bool made = false;  ///< at the last force

  /// Zeros, to be added to.
  void clear(size_t pairs, int of_size) {
    size = of_size;
    D.assign(pairs * size * size, 0.0), by_gap.assign(pairs * size, 0.0);
    made = true;
  }
  double* of(size_t pair) { return &D[pair * size * size]; }
  double* by_gap_of(size_t pair) { return &by_gap[pair * size]; }
  /// dF = D dU of every pair.
  void multiply(double const* dU, double* dF) const {
    const int step = 1;
    const double one = 1, zero = 0;
    for (size_t at = 0; at < by_gap.size(); at += size)
      dgemv_("T", &size, &size, &one, &D[at * size], &size, dU + at, &step, &zero, dF + at, &step);
  }
  /// dF for gaps that grow by dgap (pairs).
  void multiply_gaps(double const* dgap, double* dF) const {
    for (size_t k = 0; k < by_gap.size(); ++k) dF[k] = by_gap[k] * dgap[k / size];
  }
};

}  // namespace fretwave::hb
