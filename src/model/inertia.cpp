#include "model/inertia.h"

#include "mumps.h"

namespace fretwave::model {

namespace {

Mat factor_of(KSP ksp) {
  PC pc;
  Mat factor;
  check(KSPGetPC(ksp, &pc));
  check(PCFactorGetMatrix(pc, &factor));
  return factor;
}

PetscInt information(KSP ksp, PetscInt number) {
  PetscInt value = 0;
  check(MatMumpsGetInfog(factor_of(ksp), number, &value));
  return value;
}

}  // namespace

void expect_factorised(KSP ksp) {
  PC pc;
  PCFailedReason reason;
  check(KSPGetPC(ksp, &pc));
  check(PCGetFailedReason(pc, &reason));
  const PetscInt code = information(ksp, 1);
  if (reason != PC_NOERROR || code < 0)
    throw PetscFailure("the stiffness could not be factorised: MUMPS INFOG(1) = " + std::to_string(code));
}

KspHandle symmetric_factor(Mat A, std::string const& prefix, PetscInt room) {
  KspHandle ksp;
  PC pc;
  MPI_Comm comm;
  check(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(KSPCreate(comm, ksp.out()));
  check(KSPSetOptionsPrefix(ksp, prefix.c_str()));
  check(KSPSetOperators(ksp, A, A));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCCHOLESKY));
  check(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
  check(PCFactorSetUpMatSolverType(pc));
  const Mat factor = factor_of(ksp);
  check(MatMumpsSetIcntl(factor, 13, 1));  // no ScaLAPACK root, or its pivots are not counted
  check(MatMumpsSetIcntl(factor, 14, room));
  check(MatMumpsSetIcntl(factor, 24, 1));
  check(MatMumpsSetCntl(factor, 3, null_pivot));
  check(KSPSetFromOptions(ksp));
  check(KSPSetUp(ksp));
  expect_factorised(ksp);
  return ksp;
}

PetscInt negative_pivots(KSP ksp) { return information(ksp, 12); }
PetscInt null_pivots(KSP ksp) { return information(ksp, 28); }
double factor_megabytes(KSP ksp) { return information(ksp, 22); }

double factor_entries(KSP ksp) { return large_count(double(information(ksp, 29))); }

PetscInt count_below(Mat K, Mat M, double lambda, std::string const& prefix) {
  MatHandle A;
  check(MatDuplicate(K, MAT_COPY_VALUES, A.out()));
  check(MatAXPY(A, -lambda, M, UNKNOWN_NONZERO_PATTERN));
  return negative_pivots(symmetric_factor(A, prefix, delayed_pivots));
}

}  // namespace fretwave::model
