#pragma once

namespace fretwave::lapack {

/// Whether `multiply_flat` is worth the way around the BLAS on this machine.
bool worth_flat(int m, int n, int k);

/// C (m x n) = beta C + alpha A B, or A B^T, over k, column-major, of few rows: the coefficients of a dof,
/// innermost. A BLAS packs B anew for every product, which for so few rows takes as long as the product: of
/// 2304 x 2304 entries with 15 rows OpenBLAS 0.3.21 takes 11.6 ms and this 3.0, transposed 12.8 and 4.1, with
/// 31 rows 17.8 and 6.1, 20.5 and 8.8; of floats with 15 rows 4.9 and 1.7, 4.8 and 2.3, with 63 8.9 and 5.1,
/// 8.8 and 6.2 (one thread of a Xeon with AVX-512, kernels for SkylakeX).
void multiply_flat(bool transposed, int m, int n, int k, double alpha, double const* A, int lead_a,
                   double const* B, int lead_b, double beta, double* C, int lead_c);
void multiply_flat(bool transposed, int m, int n, int k, float alpha, float const* A, int lead_a,
                   float const* B, int lead_b, float beta, float* C, int lead_c);

/// Takes registers of AVX2 alone from here on, as a machine without AVX-512 does; for tests.
void keep_registers_narrow(bool narrow);

}  // namespace fretwave::lapack
