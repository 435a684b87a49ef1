#include "solve/direct.h"

#include <algorithm>

namespace fretwave::solve {

namespace {

constexpr PetscInt redundant_limit = 2000;  // unknowns: below, every rank factorises the whole matrix

MPI_Comm comm_of(Mat J) {
  MPI_Comm comm;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(J), &comm));
  return comm;
}

bool on_any_rank(bool here, MPI_Comm comm) {
  int any = here;
  MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPI_INT, MPI_MAX, comm);
  return any;
}

bool is_mumps(PC pc) {
  MatSolverType solver = nullptr;
  PetscBool lu, mumps;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCLU, &lu));
  if (lu) check(PCFactorGetMatSolverType(pc, &solver));
  check(PetscStrcmp(solver, MATSOLVERMUMPS, &mumps));
  return mumps;
}

/// Pivoting of nearly dense harmonic blocks outgrows MUMPS' own estimate of its workspace (+35 %), which ends
/// in a failed step.
void give_room(KSP ksp, Mat J) {
  PC pc;
  Mat factor;
  check(KSPGetPC(ksp, &pc));
  if (!is_mumps(pc)) return;
  check(KSPSetOperators(ksp, J, J));
  check(PCFactorSetUpMatSolverType(pc));
  check(PCFactorGetMatrix(pc, &factor));
  check(MatMumpsSetIcntl(factor, 14, 200));
}

/// Each rank's factor of the whole matrix, which newer PETSc (3.26) makes in the first solve only.
PetscErrorCode set_up_redundant(PC pc) {
  PetscBool redundant;
  KSP inner;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCREDUNDANT, &redundant));
  if (!redundant) return PetscErrorCode(0);
  check(PCRedundantGetKSP(pc, &inner));
  return KSPSetUp(inner);
}

}  // namespace

void use_lu(KSP ksp, Mat J) {
  PC pc;
  PetscBool dense;
  PetscInt rows;
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCLU));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(J), MATSEQDENSE, &dense));
  if (dense) return;
  check(MatGetSize(J, &rows, nullptr));
  if (comm_size(comm_of(J)) > 1 && rows <= redundant_limit) {
    check(PCSetType(pc, PCREDUNDANT));
    check(PCRedundantGetKSP(pc, &ksp));
    check(KSPGetPC(ksp, &pc));
    check(PCSetType(pc, PCLU));
    check(PCFactorSetMatSolverType(pc, MATSOLVERKLU));  // serial, pivots, quick to set up
    return;
  }
  check(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
  give_room(ksp, J);
}

bool factorise(KSP ksp, Mat J) {
  PC pc;
  PCFailedReason failed = PC_NOERROR;
  check(KSPSetOperators(ksp, J, J));
  check(KSPGetPC(ksp, &pc));
  PetscErrorCode code = KSPSetUp(ksp);
  if (!code) code = set_up_redundant(pc);
  const bool singular = code == PETSC_ERR_MAT_LU_ZRPVT || code == PETSC_ERR_LIB;
  if (!singular) {
    check(code);
    check(PCGetFailedReason(pc, &failed));
  }
  if (!on_any_rank(singular || failed != PC_NOERROR, comm_of(J))) return true;
  check(KSPReset(ksp));
  check(PCSetFailedReason(pc, PC_NOERROR));
  give_room(ksp, J);
  return false;
}

WholeFactor::WholeFactor(Bordered& bordered, std::string const& prefix) : bordered_(bordered) {
  A_ = bordered.matrix();
  check(KSPCreate(bordered.problem().comm(), ksp_.out()));
  check(KSPSetOptionsPrefix(ksp_, (prefix + "whole_").c_str()));
  use_lu(ksp_, A_);
  check(KSPSetFromOptions(ksp_));
}

void WholeFactor::build(Vec y, Vec) {
  bordered_.assemble(y, A_);
  if (!factorise(ksp_, A_)) throw SingularBlock("the Jacobian is singular");
}

void WholeFactor::apply(Vec x, Vec z) { check(KSPSolve(ksp_, x, z)); }

double WholeFactor::bytes(Problem const& problem, double unknowns) {
  constexpr double fill = 12, place = 24;
  const double entries = problem.jacobian_entries();
  const double factors = entries > 0 ? std::min(unknowns * unknowns, fill * entries) : unknowns * unknowns;
  return 8 * factors + place * entries;
}

}  // namespace fretwave::solve
