#include "flat_product.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "contact/vectorise.h"

namespace fretwave::lapack {

namespace {

// Registers of AVX2, of which there are 16, and of AVX-512, with 32. GCC 12 keeps either in memory where the
// machine has none.
template <class Real>
using Narrow __attribute__((vector_size(32))) = Real;
template <class Real>
using Wide __attribute__((vector_size(64))) = Real;

/// Of B's entries: from a column of C to the next, and from a term of its sum to the next.
struct Strides {
  size_t column, term;
};

constexpr int terms = 16;  // of transposed B at a time: as many streams through the memory

/// C += A B of some registers of A's rows, all rows `lead` apart, and some columns: the sums stay in
/// registers.
template <class Register, int registers, int columns, class Real>
FRETWAVE_INLINE void dot(Real const* A, size_t lead, int k, Real const* B, Strides strides, Real* C) {
  constexpr size_t width = sizeof(Register) / sizeof(Real);
  Register sum[columns][registers] = {};
  for (int l = 0; l < k; ++l) {
    Register a[registers];
    for (int r = 0; r < registers; ++r)  // one by one: an array that is copied whole stays in memory
      std::memcpy(&a[r], A + size_t(l) * lead + r * width, sizeof(Register));
    for (int j = 0; j < columns; ++j)
      for (int r = 0; r < registers; ++r) sum[j][r] += B[j * strides.column + l * strides.term] * a[r];
  }
  for (int j = 0; j < columns; ++j)
    for (int r = 0; r < registers; ++r) {
      Register c;
      std::memcpy(&c, C + j * lead + r * width, sizeof c);
      c += sum[j][r];
      std::memcpy(C + j * lead + r * width, &c, sizeof c);
    }
}

/// Of `rows` of them, so many registers at a time, then fewer: B comes from the cache again.
template <class Register, int registers, int columns, class Real>
FRETWAVE_INLINE void dot_rows(size_t rows, Real const* A, size_t lead, int k, Real const* B, Strides strides,
                              Real* C) {
  constexpr size_t block = registers * sizeof(Register) / sizeof(Real);
  size_t at = 0;
  for (; at + block <= rows; at += block)
    dot<Register, registers, columns>(A + at, lead, k, B, strides, C + at);
  if constexpr (registers > 1)
    if (at < rows) dot_rows<Register, registers - 1, columns>(rows - at, A + at, lead, k, B, strides, C + at);
}

/// Of all columns, so many at a time, then fewer.
template <class Register, int registers, int columns, class Real>
FRETWAVE_INLINE void dot_columns(int n, Real const* A, size_t lead, int k, Real const* B, Strides strides,
                                 Real* C) {
  int j = 0;
  for (; j + columns <= n; j += columns)
    dot_rows<Register, registers, columns>(lead, A, lead, k, B + j * strides.column, strides, C + j * lead);
  if constexpr (columns > 1)
    if (j < n)
      dot_columns<Register, registers, columns / 2>(n - j, A, lead, k, B + j * strides.column, strides,
                                                    C + j * lead);
}

template <class Real>
struct Operands {
  bool transposed;
  int m, n, k;
  Real alpha;
  Real const* A;
  int lead_a;
  Real const* B;
  int lead_b;
  Real beta;
  Real* C;
  int lead_c;
};

/// With sums of up to two registers of so many columns, or of `many` registers of half as many.
template <class Register, int many, int columns, class Real>
FRETWAVE_INLINE void flat(Operands<Real> const& x) {
  constexpr int width = sizeof(Register) / sizeof(Real);
  const int registers = (x.m + width - 1) / width;
  const size_t lead = size_t(registers) * width;
  const Strides strides =
      x.transposed ? Strides{1, size_t(x.lead_b)} : Strides{.column = size_t(x.lead_b), .term = 1};
  std::vector<Real> in(lead * x.k), out(lead * x.n);  // filled up with zeros
  for (int l = 0; l < x.k; ++l)
    for (int i = 0; i < x.m; ++i) in[l * lead + i] = x.alpha * x.A[size_t(l) * x.lead_a + i];
  const int most = x.transposed ? terms : x.k;
  for (int l = 0; l < x.k; l += most) {
    const int count = std::min(most, x.k - l);
    Real const *a = in.data() + l * lead, *b = x.B + l * strides.term;
    if constexpr (many > 2)
      if (registers > 2) {
        dot_columns<Register, many, columns / 2>(x.n, a, lead, count, b, strides, out.data());
        continue;
      }
    dot_columns<Register, 2, columns>(x.n, a, lead, count, b, strides, out.data());
  }
  for (int j = 0; j < x.n; ++j)
    for (int i = 0; i < x.m; ++i) {
      Real& c = x.C[size_t(j) * x.lead_c + i];
      c = (x.beta == 0 ? 0 : x.beta * c) + out[j * lead + i];
    }
}

// Six columns: twelve sums, A's two and B's are fifteen of sixteen registers; twelve or six: twenty-four and
// four of thirty-two.
FRETWAVE_VECTORISE void narrow(Operands<double> const& x) { flat<Narrow<double>, 2, 6>(x); }
FRETWAVE_VECTORISE void narrow(Operands<float> const& x) { flat<Narrow<float>, 2, 6>(x); }
FRETWAVE_WIDE void wide(Operands<double> const& x) { flat<Wide<double>, 4, 12>(x); }
FRETWAVE_WIDE void wide(Operands<float> const& x) { flat<Wide<float>, 4, 12>(x); }

const bool has_wide = FRETWAVE_SUPPORTS("x86-64-v4");
bool takes_wide = has_wide;

/// In wide registers where the machine has them and rows fill more than half of one.
template <class Real>
void by_registers(Operands<Real> const& x) {
  if (takes_wide && x.m > int(sizeof(Narrow<Real>) / sizeof(Real))) return wide(x);
  narrow(x);
}

constexpr int least_rows = 2, most_rows = 64, least_terms = 48;
/// Products of two entries, up to which OpenBLAS has kernels for small matrices on machines with AVX-512,
/// which are as quick; and of others, where making ready for the product takes as long.
constexpr double few = 1e6, fewest = 1e5;

}  // namespace

void keep_registers_narrow(bool narrow) { takes_wide = has_wide && !narrow; }

bool worth_flat(int m, int n, int k) {
  static const bool any = FRETWAVE_SUPPORTS("x86-64-v3");
  return any && m >= least_rows && m <= most_rows && k >= least_terms &&
         double(m) * n * k >= (takes_wide ? few : fewest);
}

void multiply_flat(bool transposed, int m, int n, int k, double alpha, double const* A, int lead_a,
                   double const* B, int lead_b, double beta, double* C, int lead_c) {
  by_registers<double>({transposed, m, n, k, alpha, A, lead_a, B, lead_b, beta, C, lead_c});
}

void multiply_flat(bool transposed, int m, int n, int k, float alpha, float const* A, int lead_a,
                   float const* B, int lead_b, float beta, float* C, int lead_c) {
  by_registers<float>({transposed, m, n, k, alpha, A, lead_a, B, lead_b, beta, C, lead_c});
}

}  // namespace fretwave::lapack
