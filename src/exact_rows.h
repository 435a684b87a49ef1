#pragma once
#include "petsc.h"

namespace fretwave {

/// Rows of a sparse matrix, in PETSc's own arrays.
struct SparseRows {
  PetscInt count;
  PetscInt const *begin, *column;
  double const* value;
};

/// y + low += A x as if with twice the digits, m coefficients of a dof side by side: where the terms of a row
/// cancel, y is what is left, and low what that is short of, below its last digit (Ogita, Rump & Oishi, SIAM
/// J. Sci. Comput. 26, 2005, Dot2). Behind x there is room for a vector register.
void multiply_exactly(SparseRows const& A, double const* x, double* y, double* low, int m);

}  // namespace fretwave
