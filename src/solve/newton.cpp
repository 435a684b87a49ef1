#include "solve/newton.h"

namespace fretwave::solve {

namespace {
constexpr PetscInt redundant_limit = 2000;
}

Newton::Newton(Problem& problem, std::string const& prefix) : bordered_(problem) {
  VecHandle y = problem.unknowns();
  right_side_ = like(y);
  J_ = bordered_.matrix();
  check(SNESCreate(problem.comm(), snes_.out()));
  check(SNESSetOptionsPrefix(snes_, prefix.c_str()));
  check(SNESSetFunction(snes_, nullptr, form_function, this));
  check(SNESSetJacobian(snes_, J_, J_, form_jacobian, this));
  check(SNESSetSolution(snes_, y));
  defaults();
  check(SNESSetFromOptions(snes_));
}

/// The residual is dimensionless (DESIGN fact 4), so one absolute tolerance serves every case.
void Newton::defaults() {
  KSP ksp;
  PC pc;
  PetscBool dense;
  check(SNESSetTolerances(snes_, 1e-10, 1e-50, 0, 25, 1000));
  check(SNESGetKSP(snes_, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCLU));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(Mat(J_)), MATSEQDENSE, &dense));
  if (dense) return;
  PetscInt rows;
  check(MatGetSize(J_, &rows, nullptr));
  if (comm_size(bordered_.problem().comm()) > 1 && rows <= redundant_limit) {
    // too small to share: every rank factorises the whole matrix
    check(PCSetType(pc, PCREDUNDANT));
    check(PCRedundantGetKSP(pc, &ksp));
    check(KSPGetPC(ksp, &pc));
    check(PCSetType(pc, PCLU));
    check(PCFactorSetMatSolverType(pc, MATSOLVERKLU));  // serial, pivots, quick to set up
    return;
  }
  check(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
}

PetscErrorCode Newton::form_function(SNES, Vec y, Vec g, void* context) {
  auto& newton = *static_cast<Newton*>(context);
  try {
    newton.bordered_.residual(y, g);
  } catch (...) {
    newton.exception_ = std::current_exception();
    return PETSC_ERR_USER;
  }
  return PetscErrorCode(0);
}

PetscErrorCode Newton::form_jacobian(SNES, Vec y, Mat, Mat J, void* context) {
  auto& newton = *static_cast<Newton*>(context);
  try {
    newton.bordered_.assemble(y, J);
  } catch (...) {
    newton.exception_ = std::current_exception();
    return PETSC_ERR_USER;
  }
  return PetscErrorCode(0);
}

Outcome Newton::solve(Vec y) {
  exception_ = nullptr;
  const PetscErrorCode code = SNESSolve(snes_, nullptr, y);
  if (exception_) std::rethrow_exception(exception_);
  check(code);
  SNESConvergedReason reason;
  PetscInt newton, linear;
  double norm;
  char const* text;
  check(SNESGetConvergedReason(snes_, &reason));
  check(SNESGetConvergedReasonString(snes_, &text));
  check(SNESGetIterationNumber(snes_, &newton));
  check(SNESGetLinearSolveIterations(snes_, &linear));
  check(SNESGetFunctionNorm(snes_, &norm));
  return {reason > 0, int(newton), int(linear), norm, text};
}

bool Newton::tangent(Vec y, Vec t) {
  bordered_.assemble(y, J_);
  check(VecSet(right_side_, 0));
  set_last_entry(right_side_, 1);
  KSP ksp;
  KSPConvergedReason reason;
  check(SNESGetKSP(snes_, &ksp));
  check(KSPSetOperators(ksp, J_, J_));
  check(KSPSolve(ksp, right_side_, t));
  check(KSPGetConvergedReason(ksp, &reason));
  return reason > 0;
}

}  // namespace fretwave::solve
