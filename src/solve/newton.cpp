#include "solve/newton.h"

#include <algorithm>

#include "error.h"

namespace fretwave::solve {

namespace {

constexpr PetscInt redundant_limit = 2000;  // unknowns: below, every rank factorises the whole matrix
// Unknowns above which the Krylov route is the quicker one where the problem has a preconditioner: on reduced
// blades of 30 to 155 dofs it took half the time of a direct Newton step at 213 unknowns, a third at 708, a
// twelfth at 2328.
constexpr PetscInt krylov_limit = 300;
constexpr double smallest_step = 1e-13;  // of a Newton step, relative to the unknowns: rounding
constexpr double stagnant_step = 1e-8;   // the same, of a step that the residual does not follow any more
constexpr double near = 100;             // times the expected rounding of the residual

/// Runs a callback's body; PETSc must not see a C++ exception.
template <class Body>
PetscErrorCode guarded(std::exception_ptr& exception, Body body) {
  try {
    body();
  } catch (...) {
    exception = std::current_exception();
    return PETSC_ERR_USER;
  }
  return PetscErrorCode(0);
}

/// A factorisation that met a zero pivot: the step fails, not the run. (LAPACK's through PETSc; KLU's is an
/// error of its library.)
bool singular(PetscErrorCode code) { return code == PETSC_ERR_MAT_LU_ZRPVT || code == PETSC_ERR_LIB; }

/// What the option says: one of two, or auto.
std::string choice(std::string const& prefix, char const* option, char const* meaning, std::string const& one,
                   std::string const& other) {
  char given[32] = "auto";
  check(PetscOptionsGetString(nullptr, prefix.c_str(), option, given, sizeof given, nullptr));
  if (given != std::string("auto") && given != one && given != other)
    throw InputError(std::string("unknown ") + meaning, given, "auto, " + one + " or " + other,
                     std::string("give ") + option + " " + other + ", or leave it out");
  return given;
}

}  // namespace

Newton::Newton(Problem& problem, std::string const& prefix) : bordered_(problem) {
  VecHandle y = problem.unknowns();
  right_side_ = like(y);
  point_ = like(y);
  check(SNESCreate(problem.comm(), snes_.out()));
  check(SNESSetOptionsPrefix(snes_, prefix.c_str()));
  check(SNESSetFunction(snes_, nullptr, form_function, this));
  // The residual is dimensionless (DESIGN fact 4), so one absolute tolerance serves every case.
  check(SNESSetTolerances(snes_, 1e-10, 1e-50, 0, 25, 1000));
  check(SNESSetConvergenceTest(snes_, converged, this, nullptr));
  choose_route(prefix);
  preconditioner_ ? use_krylov() : use_direct();
  check(SNESSetJacobian(snes_, J_, J_, form_jacobian, this));
  check(SNESSetSolution(snes_, y));
  check(SNESSetFromOptions(snes_));
}

void Newton::choose_route(std::string const& prefix) {
  PetscInt unknowns;
  check(VecGetSize(point_, &unknowns));
  const std::string wish = choice(prefix, "-route", "route of the corrector", "direct", "krylov");
  const std::string blocks = choice(prefix, "-blocks", "kind of preconditioner", "dense", "sparse");
  if (wish == "krylov" || (wish == "auto" && unknowns > krylov_limit))
    preconditioner_ = bordered_.problem().preconditioner(blocks);
  route_ = std::string(preconditioner_ ? "krylov" : "direct") + " (" +
           (wish == "auto" ? std::to_string(unknowns) + " unknowns" : "asked for") + ")";
}

std::string Newton::route() const {
  return route_ + (preconditioner_ ? ", " + preconditioner_->describe() : "");
}

void Newton::use_direct() {
  KSP ksp;
  PC pc;
  PetscBool dense;
  PetscInt rows;
  J_ = bordered_.matrix();
  check(SNESGetKSP(snes_, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCLU));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(Mat(J_)), MATSEQDENSE, &dense));
  if (dense) return;
  check(MatGetSize(J_, &rows, nullptr));
  if (comm_size(bordered_.problem().comm()) > 1 && rows <= redundant_limit) {
    check(PCSetType(pc, PCREDUNDANT));
    check(PCRedundantGetKSP(pc, &ksp));
    check(KSPGetPC(ksp, &pc));
    check(PCSetType(pc, PCLU));
    check(PCFactorSetMatSolverType(pc, MATSOLVERKLU));  // serial, pivots, quick to set up
    return;
  }
  check(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
  // Pivoting of nearly dense harmonic blocks outgrows MUMPS' own estimate of its workspace (+35 %), which
  // ends in a failed step.
  Mat factor;
  check(KSPSetOperators(ksp, J_, J_));
  check(PCFactorSetUpMatSolverType(pc));
  check(PCFactorGetMatrix(pc, &factor));
  check(MatMumpsSetIcntl(factor, 14, 200));
}

void Newton::use_krylov() {
  KSP ksp;
  PC pc;
  const PetscInt local = local_size(point_);
  check(MatCreateShell(bordered_.problem().comm(), local, local, PETSC_DETERMINE, PETSC_DETERMINE, this,
                       J_.out()));
  check(MatShellSetOperation(J_, MATOP_MULT, reinterpret_cast<void (*)(void)>(shell_product)));
  check(SNESGetKSP(snes_, &ksp));
  check(KSPSetType(ksp, KSPFGMRES));
  check(KSPGMRESSetRestart(ksp, 100));
  check(KSPSetTolerances(ksp, 1e-6, 1e-13, PETSC_DEFAULT, 200));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCSHELL));
  check(PCShellSetContext(pc, this));
  check(PCShellSetApply(pc, shell_precondition));
}

/// PETSc's test, and: a residual or a full step at rounding level ends the iteration, and a small step under
/// which a residual near that level no longer halves: it cannot fall further. It stays above the tolerance
/// where forces cancel that are far above those measured with (a stiff contact under preload at a small
/// amplitude, the element forces of a fine mesh); the point's residual says so.
PetscErrorCode Newton::converged(SNES snes, PetscInt iteration, PetscReal unknowns, PetscReal step,
                                 PetscReal residual, SNESConvergedReason* reason, void* context) {
  PetscErrorCode code = SNESConvergedDefault(snes, iteration, unknowns, step, residual, reason, nullptr);
  auto& newton = *static_cast<Newton*>(context);
  const bool stagnates = residual > 0.5 * newton.residual_before_;
  newton.residual_before_ = residual;
  if (code || *reason || iteration == 0) return code;
  Vec y;
  double rounding = 0;
  code = SNESGetSolution(snes, &y);
  if (!code) code = guarded(newton.exception_, [&] { rounding = newton.bordered_.problem().rounding(y); });
  if (code) return code;
  unknowns = std::max(unknowns, 1.0);
  const bool near_rounding = residual <= near * rounding && step <= stagnant_step * unknowns;
  if (residual <= rounding || (stagnates && near_rounding)) {
    *reason = SNES_CONVERGED_FNORM_ABS;
    return code;
  }
  if (step > smallest_step * unknowns) return code;
  SNESLineSearch search;
  PetscReal fraction;
  code = SNESGetLineSearch(snes, &search);
  if (!code) code = SNESLineSearchGetLambda(search, &fraction);
  if (!code && fraction == 1) *reason = SNES_CONVERGED_SNORM_RELATIVE;
  return code;
}

/// The line search found nothing lower along a step this small: rounding, as in `converged`.
bool Newton::at_rounding(Vec y) {
  Vec step;
  double length, unknowns, residual;
  check(SNESGetSolutionUpdate(snes_, &step));
  check(SNESGetFunctionNorm(snes_, &residual));
  check(VecNorm(step, NORM_2, &length));
  check(VecNorm(y, NORM_2, &unknowns));
  return length <= stagnant_step * std::max(unknowns, 1.0) &&
         residual <= near * bordered_.problem().rounding(y);
}

PetscErrorCode Newton::form_function(SNES, Vec y, Vec g, void* context) {
  auto& newton = *static_cast<Newton*>(context);
  return guarded(newton.exception_, [&] { newton.bordered_.residual(y, g); });
}

PetscErrorCode Newton::form_jacobian(SNES, Vec y, Mat, Mat, void* context) {
  auto& newton = *static_cast<Newton*>(context);
  return guarded(newton.exception_, [&] { newton.linearise(y); });
}

PetscErrorCode Newton::shell_product(Mat J, Vec x, Vec y) {
  Newton* newton;
  PetscErrorCode code = MatShellGetContext(J, &newton);
  if (code) return code;
  return guarded(newton->exception_, [&] { newton->bordered_.product(newton->point_, x, y); });
}

PetscErrorCode Newton::shell_precondition(PC pc, Vec x, Vec y) {
  Newton* newton;
  PetscErrorCode code = PCShellGetContext(pc, &newton);
  if (code) return code;
  return guarded(newton->exception_, [&] { newton->preconditioner_->apply(x, y); });
}

/// The preconditioner is stale once the iterations beyond those just after it was built have cost as much as
/// building; at once, if even its first reuse cost more the last time.
void Newton::count_iterations() {
  PetscInt iterations = 0;
  KSP ksp;
  check(SNESGetKSP(snes_, &ksp));
  check(KSPGetIterationNumber(ksp, &iterations));
  const double cost = preconditioner_->build_cost();
  if (fresh_ < 0) {
    fresh_ = int(iterations);
    stale_ = first_reuse_ > cost;
    first_reuse_ /= 2;
    return;
  }
  if (excess_ == 0) first_reuse_ = std::max(0, int(iterations) - fresh_);
  excess_ += std::max(0, int(iterations) - fresh_);
  stale_ = excess_ > cost;
}

void Newton::linearise(Vec y) {
  if (!preconditioner_) return bordered_.assemble(y, J_);
  check(VecCopy(y, point_));
  if (!stale_) count_iterations();
  if (stale_) {
    preconditioner_->build(point_, bordered_.row());
    stale_ = false;
    fresh_ = -1, excess_ = 0;
  }
  check(MatAssemblyBegin(J_, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(J_, MAT_FINAL_ASSEMBLY));
}

Outcome Newton::solve(Vec y) {
  exception_ = nullptr;
  const PetscErrorCode code = SNESSolve(snes_, nullptr, y);
  if (exception_) std::rethrow_exception(exception_);
  if (singular(code)) return {.reason = "the Jacobian is singular"};
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
  if (reason == SNES_DIVERGED_LINE_SEARCH && at_rounding(y)) reason = SNES_CONVERGED_SNORM_RELATIVE;
  if (reason < 0) stale_ = true;
  return {reason > 0, int(newton), int(linear), norm, text};
}

bool Newton::tangent(Vec y, Vec t) {
  check(VecSet(right_side_, 0));
  set_last_entry(right_side_, 1);
  return linear(y, right_side_, t);
}

/// Behind a kink of the branch the last tangent can be a guess so bad that GMRES takes it for divergence.
bool Newton::linear(Vec y, Vec b, Vec x) {
  linearise(y);
  if (solve_linear(b, x)) return true;
  if (!preconditioner_) return false;
  check(VecSet(x, 0));
  return solve_linear(b, x);
}

bool Newton::solve_linear(Vec b, Vec x) {
  KSP ksp;
  KSPConvergedReason reason;
  check(SNESGetKSP(snes_, &ksp));
  check(KSPSetOperators(ksp, J_, J_));
  check(KSPSetInitialGuessNonzero(ksp, preconditioner_ ? PETSC_TRUE : PETSC_FALSE));
  const PetscErrorCode code = KSPSolve(ksp, b, x);
  check(KSPSetInitialGuessNonzero(ksp, PETSC_FALSE));
  if (exception_) std::rethrow_exception(exception_);
  if (singular(code)) return false;
  check(code);
  check(KSPGetConvergedReason(ksp, &reason));
  return reason > 0;
}

}  // namespace fretwave::solve
