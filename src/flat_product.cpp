#include "flat_product.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "contact/vectorise.h"

namespace fretwave::lapack {

namespace {

// Of a register of AVX2; GCC 12 keeps wider ones in memory (blocked_product.cpp).
constexpr int bytes = 32;

template <class Real>
constexpr int width = bytes / int(sizeof(Real));

/// Of B's entries: from a column of C to the next, and from a term of its sum to the next.
struct Strides {
  size_t column, term;
};

constexpr int together = 6;  // columns: sums of two registers each, and A's two, B's: fifteen of sixteen
constexpr int terms = 16;    // of transposed B at a time: as many streams through the memory

/// C += A B of some registers of A's rows and some columns: the sums stay in registers.
template <class Real, int registers, int columns>
FRETWAVE_INLINE void dot(Real const* A, size_t step, int k, Real const* B, Strides strides, Real* C) {
  using Register __attribute__((vector_size(bytes))) = Real;
  Register sum[columns][registers] = {};
  for (int l = 0; l < k; ++l) {
    Register a[registers];
    for (int r = 0; r < registers; ++r)  // one by one: an array that is copied whole stays in memory
      std::memcpy(&a[r], A + size_t(l) * step + r * width<Real>, bytes);
    for (int j = 0; j < columns; ++j)
      for (int r = 0; r < registers; ++r) sum[j][r] += B[j * strides.column + l * strides.term] * a[r];
  }
  for (int j = 0; j < columns; ++j)
    for (int r = 0; r < registers; ++r) {
      Register c;
      std::memcpy(&c, C + j * step + r * width<Real>, bytes);
      c += sum[j][r];
      std::memcpy(C + j * step + r * width<Real>, &c, bytes);
    }
}

/// All rows, registers by two.
template <int columns, class Real>
FRETWAVE_INLINE void dot_all(Real const* A, size_t step, int k, Real const* B, Strides strides, Real* C) {
  constexpr size_t w = width<Real>;
  size_t at = 0;
  for (; at + w < step; at += 2 * w) dot<Real, 2, columns>(A + at, step, k, B, strides, C + at);
  if (at < step) dot<Real, 1, columns>(A + at, step, k, B, strides, C + at);
}

template <class Real>
FRETWAVE_INLINE void flat(int m, int n, int k, Real alpha, Real const* A, size_t lead_a, Real const* B,
                          Strides strides, Real beta, Real* C, size_t lead_c) {
  const size_t step = size_t((m + width<Real> - 1) / width<Real>) * width<Real>;
  std::vector<Real> in(step * k), out(step * n);  // filled up with zeros
  for (int l = 0; l < k; ++l)
    for (int i = 0; i < m; ++i) in[l * step + i] = alpha * A[l * lead_a + i];
  const int most = strides.term == 1 ? k : terms;
  for (int l = 0; l < k; l += most) {
    const int count = std::min(most, k - l);
    Real const *a = &in[l * step], *b = B + l * strides.term;
    int j = 0;
    for (; j + together <= n; j += together)
      dot_all<together>(a, step, count, b + j * strides.column, strides, &out[j * step]);
    for (; j < n; ++j) dot_all<1>(a, step, count, b + j * strides.column, strides, &out[j * step]);
  }
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < m; ++i)
      C[j * lead_c + i] = (beta == 0 ? 0 : beta * C[j * lead_c + i]) + out[j * step + i];
}

Strides strides_of(bool transposed, int lead) {
  return transposed ? Strides{1, size_t(lead)} : Strides{size_t(lead), 1};
}

}  // namespace

FRETWAVE_VECTORISE
void multiply_flat(bool transposed, int m, int n, int k, double alpha, double const* A, int lead_a,
                   double const* B, int lead_b, double beta, double* C, int lead_c) {
  flat(m, n, k, alpha, A, size_t(lead_a), B, strides_of(transposed, lead_b), beta, C, size_t(lead_c));
}

FRETWAVE_VECTORISE
void multiply_flat(bool transposed, int m, int n, int k, float alpha, float const* A, int lead_a,
                   float const* B, int lead_b, float beta, float* C, int lead_c) {
  flat(m, n, k, alpha, A, size_t(lead_a), B, strides_of(transposed, lead_b), beta, C, size_t(lead_c));
}

}  // namespace fretwave::lapack
