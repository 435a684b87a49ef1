#pragma once
#include <algorithm>
#include <array>
#include <complex>
#include <type_traits>
#include <vector>

#include "flat_product.h"

/// The BLAS and LAPACK routines in use, and the inverse made of two of them.
extern "C" {
double ddot_(int const*, double const*, int const*, double const*, int const*);
void dgemm_(char const*, char const*, int const*, int const*, int const*, double const*, double const*,
            int const*, double const*, int const*, double const*, double*, int const*);
void sgemm_(char const*, char const*, int const*, int const*, int const*, float const*, float const*,
            int const*, float const*, int const*, float const*, float*, int const*);
void dgemv_(char const*, int const*, int const*, double const*, double const*, int const*, double const*,
            int const*, double const*, double*, int const*);
void sgemv_(char const*, int const*, int const*, float const*, float const*, int const*, float const*,
            int const*, float const*, float*, int const*);
void cgemv_(char const*, int const*, int const*, std::complex<float> const*, std::complex<float> const*,
            int const*, std::complex<float> const*, int const*, std::complex<float> const*,
            std::complex<float>*, int const*);
void cgemm_(char const*, char const*, int const*, int const*, int const*, std::complex<float> const*,
            std::complex<float> const*, int const*, std::complex<float> const*, int const*,
            std::complex<float> const*, std::complex<float>*, int const*);
void zgemm_(char const*, char const*, int const*, int const*, int const*, std::complex<double> const*,
            std::complex<double> const*, int const*, std::complex<double> const*, int const*,
            std::complex<double> const*, std::complex<double>*, int const*);
void dsyrk_(char const*, char const*, int const*, int const*, double const*, double const*, int const*,
            double const*, double*, int const*);
void dgesv_(int const*, int const*, double*, int const*, int*, double*, int const*, int*);
void sgesv_(int const*, int const*, float*, int const*, int*, float*, int const*, int*);
void zgesv_(int const*, int const*, std::complex<double>*, int const*, int*, std::complex<double>*,
            int const*, int*);
void zgemv_(char const*, int const*, int const*, std::complex<double> const*, std::complex<double> const*,
            int const*, std::complex<double> const*, int const*, std::complex<double> const*,
            std::complex<double>*, int const*);
void dgetrf_(int const*, int const*, double*, int const*, int*, int*);
void dgetrs_(char const*, int const*, int const*, double const*, int const*, int const*, double*, int const*,
             int*);
void dgetri_(int const*, double*, int const*, int const*, double*, int const*, int*);
void dsygvd_(int const*, char const*, char const*, int const*, double*, int const*, double*, int const*,
             double*, double*, int const*, int*, int const*, int*);
void zhegvd_(int const*, char const*, char const*, int const*, std::complex<double>*, int const*,
             std::complex<double>*, int const*, double*, std::complex<double>*, int const*, double*,
             int const*, int*, int const*, int*);
void dpotrf_(char const*, int const*, double*, int const*, int*);
void dpotri_(char const*, int const*, double*, int const*, int*);
void dsygst_(int const*, char const*, int const*, double*, int const*, double const*, int const*, int*);
void dtrtri_(char const*, char const*, int const*, double*, int const*, int*);
void dgeqrf_(int const*, int const*, double*, int const*, double*, double*, int const*, int*);
void dormqr_(char const*, char const*, int const*, int const*, int const*, double const*, int const*,
             double const*, double*, int const*, double*, int const*, int*);
void zpotrf_(char const*, int const*, std::complex<double>*, int const*, int*);
void zpotrs_(char const*, int const*, int const*, std::complex<double> const*, int const*,
             std::complex<double>*, int const*, int*);
void dpstrf_(char const*, int const*, double*, int const*, int*, int*, double const*, double*, int*);
void dtrsm_(char const*, char const*, char const*, char const*, int const*, int const*, double const*,
            double const*, int const*, double*, int const*);
void zgetrf_(int const*, int const*, std::complex<double>*, int const*, int*, int*);
void zgetri_(int const*, std::complex<double>*, int const*, int const*, std::complex<double>*, int const*,
             int*);
}

namespace fretwave::lapack {

inline void factorise(int const* n, double* A, int* pivots, int* info) { dgetrf_(n, n, A, n, pivots, info); }
inline void factorise(int const* n, std::complex<double>* A, int* pivots, int* info) {
  zgetrf_(n, n, A, n, pivots, info);
}
inline void invert(int const* n, double* A, int const* pivots, double* work, int const* size, int* info) {
  dgetri_(n, A, n, pivots, work, size, info);
}
inline void invert(int const* n, std::complex<double>* A, int const* pivots, std::complex<double>* work,
                   int const* size, int* info) {
  zgetri_(n, A, n, pivots, work, size, info);
}

/// A := A^-1, n x n, column-major. Returns LAPACK's info, 0 if A is regular.
template <class T>
int invert(std::vector<T>& A, int n) {
  const int work_size = 64 * n;
  std::vector<int> pivots(n);
  std::vector<T> work(work_size);
  int info;
  factorise(&n, A.data(), pivots.data(), &info);
  if (info == 0) invert(&n, A.data(), pivots.data(), work.data(), &work_size, &info);
  return info;
}

inline void solve(int n, int columns, float* A, int* pivots, float* B, int* info) {
  sgesv_(&n, &columns, A, &n, pivots, B, &n, info);
}
inline void solve(int n, int columns, double* A, int* pivots, double* B, int* info) {
  dgesv_(&n, &columns, A, &n, pivots, B, &n, info);
}
inline void solve(int n, int columns, std::complex<double>* A, int* pivots, std::complex<double>* B,
                  int* info) {
  zgesv_(&n, &columns, A, &n, pivots, B, &n, info);
}

/// B := A^-1 B, columns of it, both column-major; A is overwritten. Returns LAPACK's info, 0 if A is regular.
template <class T>
int solve(std::vector<T>& A, int n, std::vector<T>& B, int columns) {
  std::vector<int> pivots(n);
  int info;
  solve(n, columns, A.data(), pivots.data(), B.data(), &info);
  return info;
}

/// A dense matrix, column-major.
template <class T>
struct Dense {
  T const* data;
  int lead;
};

inline void gemm(char const* ops, std::array<int, 3> const& size, float alpha, Dense<float> A, Dense<float> B,
                 float beta, float* C, int lead) {
  sgemm_(ops, ops + 1, &size[0], &size[1], &size[2], &alpha, A.data, &A.lead, B.data, &B.lead, &beta, C,
         &lead);
}
inline void gemm(char const* ops, std::array<int, 3> const& size, double alpha, Dense<double> A,
                 Dense<double> B, double beta, double* C, int lead) {
  dgemm_(ops, ops + 1, &size[0], &size[1], &size[2], &alpha, A.data, &A.lead, B.data, &B.lead, &beta, C,
         &lead);
}
inline void gemm(char const* ops, std::array<int, 3> const& size, std::complex<float> alpha,
                 Dense<std::complex<float>> A, Dense<std::complex<float>> B, std::complex<float> beta,
                 std::complex<float>* C, int lead) {
  cgemm_(ops, ops + 1, &size[0], &size[1], &size[2], &alpha, A.data, &A.lead, B.data, &B.lead, &beta, C,
         &lead);
}
inline void gemm(char const* ops, std::array<int, 3> const& size, std::complex<double> alpha,
                 Dense<std::complex<double>> A, Dense<std::complex<double>> B, std::complex<double> beta,
                 std::complex<double>* C, int lead) {
  zgemm_(ops, ops + 1, &size[0], &size[1], &size[2], &alpha, A.data, &A.lead, B.data, &B.lead, &beta, C,
         &lead);
}

/// C (m x n) = beta C + alpha op(A) op(B), over k; size = {m, n, k}, each may be zero.
template <class T>
void multiply(char const* ops, std::array<int, 3> size, std::type_identity_t<T> alpha,
              std::type_identity_t<Dense<T>> A, std::type_identity_t<Dense<T>> B,
              std::type_identity_t<T> beta, T* C, int lead) {
  if (size[0] == 0 || size[1] == 0) return;
  A.lead = std::max(A.lead, 1), B.lead = std::max(B.lead, 1);
  if constexpr (std::is_floating_point_v<T>)
    if (ops[0] == 'N' && worth_flat(size[0], size[1], size[2]))
      return multiply_flat(ops[1] != 'N', size[0], size[1], size[2], alpha, A.data, A.lead, B.data, B.lead,
                           beta, C, lead);
  gemm(ops, size, alpha, A, B, beta, C, lead);
}

/// One triangle of C, n x n, "L" or "U", onto the other.
inline void mirror(char const* triangle, int n, double* C) {
  const int tile = 64;
  const bool lower = *triangle == 'L';
  for (int first = 0; first < n; first += tile)
    for (int below = first; below < n; below += tile)
      for (int j = first; j < std::min(first + tile, n); ++j)
        for (int i = std::max(below, j + 1); i < std::min(below + tile, n); ++i) {
          double &of_lower = C[size_t(j) * n + i], &of_upper = C[size_t(i) * n + j];
          (lower ? of_upper : of_lower) = lower ? of_lower : of_upper;
        }
}

/// C += alpha A A^T, both triangles, of n rows and k columns.
inline void add_squares(int n, int k, double alpha, double const* A, double* C) {
  const double one = 1;
  dsyrk_("L", "N", &n, &k, &alpha, A, &n, &one, C, &n);
  mirror("L", n, C);
}

/// Rows to which a flat matrix is filled up for the BLAS, where it goes there: of 1200 x 1200 floats one with
/// 15 rows takes OpenBLAS 0.92 ms, with 16 0.57.
inline int filled_up(int rows) {
  const int multiple = rows <= 2 ? 1 : rows <= 4 ? 4 : 8;
  return (rows + multiple - 1) / multiple * multiple;
}

/// Columns of c entries in single precision, each filled up with zeros.
inline std::vector<float> filled_up(double const* x, int c, int columns) {
  const int lead = filled_up(c);
  std::vector<float> out(size_t(lead) * columns);
  for (int j = 0; j < columns; ++j)
    for (int k = 0; k < c; ++k) out[size_t(j) * lead + k] = float(x[size_t(j) * c + k]);
  return out;
}

/// Those columns without what they were filled up with.
inline void take(std::vector<float> const& x, int c, int columns, double* to) {
  const int lead = filled_up(c);
  for (int j = 0; j < columns; ++j)
    for (int k = 0; k < c; ++k) to[size_t(j) * c + k] = x[size_t(j) * lead + k];
}

/// A x, A rows x columns, column-major. Where rows are two more than a multiple of four, cgemv of OpenBLAS
/// 0.3.21 (Debian 12's) reads the entry behind the last of x: there is one.
inline std::vector<std::complex<float>> product(int rows, int columns, std::complex<float> const* A,
                                                std::vector<std::complex<float>> x) {
  const int step = 1;
  const std::complex<float> one = 1, zero = 0;
  std::vector<std::complex<float>> out(rows);
  x.emplace_back();
  cgemv_("N", &rows, &columns, &one, A, &rows, x.data(), &step, &zero, out.data(), &step);
  return out;
}

}  // namespace fretwave::lapack
