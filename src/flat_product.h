#pragma once

namespace fretwave::lapack {

/// Rows of a flat product, and how many terms make it worth the way around the BLAS.
constexpr int least_rows = 3, most_rows = 16, least_terms = 128;

/// C (m x n) = beta C + alpha A B, or A B^T, over k, column-major, of few rows: the coefficients of a dof,
/// innermost. A BLAS packs B anew for every product, which for so few rows takes as long as the product: of
/// 2304 x 2304 entries with 15 rows OpenBLAS takes 10.3 ms and this 5.0, transposed 11.4 and 6.7; of floats
/// 10.0 and 2.2, 7.2 and 2.7 (one thread, AVX2; with 32 rows both are alike).
void multiply_flat(bool transposed, int m, int n, int k, double alpha, double const* A, int lead_a,
                   double const* B, int lead_b, double beta, double* C, int lead_c);
void multiply_flat(bool transposed, int m, int n, int k, float alpha, float const* A, int lead_a,
                   float const* B, int lead_b, float beta, float* C, int lead_c);

}  // namespace fretwave::lapack
