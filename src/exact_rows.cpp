/// Compiled without contraction (CMakeLists.txt): a product fused into a sum has no rounding to be told.
#include "exact_rows.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "contact/vectorise.h"

namespace fretwave {

namespace {

constexpr int width = 4, most = 4;  // registers of AVX2, as in blocked_product.cpp: half of them hold sums
using Register = double __attribute__((vector_size(width * sizeof(double))));

/// Adds what `sum`, the rounded a + b, is short of (Knuth).
template <class Real>
FRETWAVE_INLINE void add_rest_of_sum(Real const& a, Real const& b, Real const& sum, Real& out) {
  const Real of_b = sum - a;
  out += (a - (sum - of_b)) + (b - of_b);
}

/// Adds what `product`, the rounded a b, is short of.
FRETWAVE_INLINE void add_rest_of_product(double a, Register const& b, Register const& product,
                                         Register& out) {
  for (int i = 0; i < width; ++i) out[i] += std::fma(a, b[i], -product[i]);
}

/// Of some registers of each dof's coefficients; behind these the next dof's are summed too, and left out.
template <int registers>
FRETWAVE_INLINE void multiply(SparseRows const& A, double const* x, double* y, double* low, size_t m,
                              int coefficients) {
  for (PetscInt row = 0; row < A.count; ++row, y += m, low += m) {
    Register sum[registers] = {}, left[registers] = {};
    for (PetscInt k = A.begin[row]; k < A.begin[row + 1]; ++k) {
      double const* of_dof = x + size_t(A.column[k]) * m;
      for (int r = 0; r < registers; ++r) {
        Register in;
        std::memcpy(&in, of_dof + r * width, sizeof in);
        const Register product = A.value[k] * in, before = sum[r];
        sum[r] += product;
        add_rest_of_sum(before, product, sum[r], left[r]);
        add_rest_of_product(A.value[k], in, product, left[r]);
      }
    }
    for (int i = 0; i < coefficients; ++i) {
      const double before = y[i], more = sum[i / width][i % width], high = before + more;
      double below = low[i] + left[i / width][i % width];
      add_rest_of_sum(before, more, high, below);
      y[i] = high + below, low[i] = 0;
      add_rest_of_sum(high, below, y[i], low[i]);
    }
  }
}

template <int registers = 1>
FRETWAVE_INLINE void multiply_by_fewest(SparseRows const& A, double const* x, double* y, double* low,
                                        size_t m, int coefficients) {
  if constexpr (registers < most)
    if (coefficients > registers * width)
      return multiply_by_fewest<registers + 1>(A, x, y, low, m, coefficients);
  multiply<registers>(A, x, y, low, m, coefficients);
}

}  // namespace

FRETWAVE_VECTORISE
void multiply_exactly(SparseRows const& A, double const* x, double* y, double* low, int m) {
  for (int first = 0; first < m; first += most * width)
    multiply_by_fewest(A, x + first, y + first, low + first, size_t(m), std::min(most * width, m - first));
}

}  // namespace fretwave
