#include "model/static_factor.h"

#include "model/inertia.h"

namespace fretwave::model {

MatHandle dense_columns(Mat like, PetscInt columns) {
  MatHandle out;
  MPI_Comm comm;
  PetscInt rows, local;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(like), &comm));
  check(MatGetSize(like, &rows, nullptr));
  check(MatGetLocalSize(like, &local, nullptr));
  check(MatCreateDense(comm, local, PETSC_DECIDE, rows, columns, nullptr, out.out()));
  check(MatAssemblyBegin(out, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(out, MAT_FINAL_ASSEMBLY));
  return out;
}

StaticFactor::StaticFactor(Mat K) : K_(MatHandle::share(K)), ksp_(symmetric_factor(K, "static_")) {
  check(MatGetLocalSize(K_, &local_, nullptr));
  definite_ = negative_pivots(ksp_) == 0 && null_pivots(ksp_) == 0;
  megabytes_ = factor_megabytes(ksp_), entries_ = factor_entries(ksp_);
}

void StaticFactor::solve(Mat B, Mat X) const {
  check(KSPMatSolve(ksp_, B, X));
  expect_factorised(ksp_);
}

void StaticFactor::solve(double const* x, int coefficients, double* y) const {
  const MatHandle B = dense_columns(K_, coefficients), X = dense_columns(K_, coefficients);
  PetscInt lead;
  double* columns;
  check(MatDenseGetLDA(B, &lead));
  check(MatDenseGetArrayWrite(B, &columns));
  for (PetscInt i = 0; i < local_; ++i)
    for (int k = 0; k < coefficients; ++k) columns[size_t(k) * lead + i] = x[size_t(i) * coefficients + k];
  check(MatDenseRestoreArrayWrite(B, &columns));
  solve(B, X);
  double const* found;
  check(MatDenseGetLDA(X, &lead));
  check(MatDenseGetArrayRead(X, &found));
  for (PetscInt i = 0; i < local_; ++i)
    for (int k = 0; k < coefficients; ++k) y[size_t(i) * coefficients + k] = found[size_t(k) * lead + i];
  check(MatDenseRestoreArrayRead(X, &found));
}

}  // namespace fretwave::model
