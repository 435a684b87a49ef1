#pragma once
#include <string>

namespace fretwave {

/// The kernels OpenBLAS runs on this machine, such as "SkylakeX"; empty with another BLAS.
std::string blas_kernels();

/// OpenBLAS before 0.3.25 (Debian 12 has 0.3.21) takes Intel processors newer than itself for a Prescott, of
/// 2004: it chooses again, told what this one has, unless OPENBLAS_CORETYPE says what to take. No other
/// thread may multiply meanwhile. On an Emerald
/// Rapids a dgemm of 2000 rows is 2.6 times as fast with AVX2 and 4.4 times with AVX-512
/// (github.com/OpenMathLib/OpenBLAS issue 4267).
void mend_blas_kernels();

}  // namespace fretwave
