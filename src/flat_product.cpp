#include "flat_product.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "contact/vectorise.h"

namespace fretwave::lapack {

namespace {

// Of a register of AVX2; GCC 12 keeps wider ones in memory (hb/blocked_product.cpp).
constexpr int bytes = 32;

template <class Real>
constexpr int width = bytes / int(sizeof(Real));

/// C += A B of some registers of A's rows and some columns: the sums stay in registers.
template <class Real, int registers, int columns>
FRETWAVE_INLINE void dot(Real const* A, size_t step, int k, Real const* B, size_t lead, int rows, Real* C,
                         size_t lead_c) {
  using Register __attribute__((vector_size(bytes))) = Real;
  Register sum[columns][registers] = {};
  for (int l = 0; l < k; ++l) {
    Register a[registers];
    for (int r = 0; r < registers; ++r)  // one by one: an array that is copied whole stays in memory
      std::memcpy(&a[r], A + size_t(l) * step + r * width<Real>, bytes);
    for (int j = 0; j < columns; ++j)
      for (int r = 0; r < registers; ++r) sum[j][r] += B[j * lead + l] * a[r];
  }
  for (int j = 0; j < columns; ++j)
    for (int i = 0; i < rows; ++i) C[j * lead_c + i] += sum[j][i / width<Real>][i % width<Real>];
}

/// All rows, registers by two.
template <int columns, class Real>
FRETWAVE_INLINE void dot_all(Real const* A, size_t step, int m, int k, Real const* B, size_t lead, Real* C,
                             size_t lead_c) {
  constexpr int w = width<Real>;
  int at = 0;
  for (; at + w < m; at += 2 * w)
    dot<Real, 2, columns>(A + at, step, k, B, lead, std::min(m - at, 2 * w), C + at, lead_c);
  if (at < m) dot<Real, 1, columns>(A + at, step, k, B, lead, m - at, C + at, lead_c);
}

template <class Real>
FRETWAVE_INLINE void flat(int m, int n, int k, Real alpha, Real const* A, size_t lead_a, Real const* B,
                          size_t lead_b, Real beta, Real* C, size_t lead_c) {
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < m; ++i) C[j * lead_c + i] = beta == 0 ? 0 : beta * C[j * lead_c + i];
  const size_t step = size_t((m + width<Real> - 1) / width<Real>) * width<Real>;
  std::vector<Real> in(step * k);  // filled up with zeros
  for (int l = 0; l < k; ++l)
    for (int i = 0; i < m; ++i) in[l * step + i] = alpha * A[l * lead_a + i];
  int j = 0;
  for (; j + 4 <= n; j += 4)
    dot_all<4>(in.data(), step, m, k, B + j * lead_b, lead_b, C + j * lead_c, lead_c);
  for (; j < n; ++j) dot_all<1>(in.data(), step, m, k, B + j * lead_b, lead_b, C + j * lead_c, lead_c);
}

}  // namespace

FRETWAVE_VECTORISE
void multiply_flat(int m, int n, int k, double alpha, double const* A, int lead_a, double const* B,
                   int lead_b, double beta, double* C, int lead_c) {
  flat(m, n, k, alpha, A, size_t(lead_a), B, size_t(lead_b), beta, C, size_t(lead_c));
}

FRETWAVE_VECTORISE
void multiply_flat(int m, int n, int k, float alpha, float const* A, int lead_a, float const* B, int lead_b,
                   float beta, float* C, int lead_c) {
  flat(m, n, k, alpha, A, size_t(lead_a), B, size_t(lead_b), beta, C, size_t(lead_c));
}

}  // namespace fretwave::lapack
