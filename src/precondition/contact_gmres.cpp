#include "precondition/contact_gmres.h"

namespace fretwave::precondition {

ContactGmres::ContactGmres(MPI_Comm comm, PetscInt local, Product product, double tolerance, int most)
    : product_(std::move(product)) {
  PC pc;
  PetscInt size;
  right_ = make_vector(comm, local), x_ = like(right_);
  check(VecGetSize(x_, &size));
  check(MatCreateShell(comm, local, local, size, size, this, A_.out()));
  check(MatShellSetOperation(A_, MATOP_MULT, reinterpret_cast<void (*)(void)>(shell_product)));
  check(KSPCreate(comm, ksp_.out()));
  check(KSPSetOperators(ksp_, A_, A_));
  check(KSPSetType(ksp_, KSPGMRES));
  check(KSPGMRESSetRestart(ksp_, most));
  check(KSPSetTolerances(ksp_, tolerance, PETSC_DEFAULT, PETSC_DEFAULT, most));
  check(KSPGetPC(ksp_, &pc));
  check(PCSetType(pc, PCNONE));
}

PetscErrorCode ContactGmres::shell_product(Mat A, Vec in, Vec out) {
  ContactGmres* self;
  const PetscErrorCode code = MatShellGetContext(A, &self);
  if (code) return code;
  return self->guard_.run([&] { self->product_(in, out); });
}

Vec ContactGmres::solve() {
  const PetscErrorCode code = KSPSolve(ksp_, right_, x_);
  guard_.rethrow();
  check(code);
  return x_;
}

}  // namespace fretwave::precondition
