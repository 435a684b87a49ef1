#include "solve/linear_solver.h"

#include <algorithm>

#include "error.h"

namespace fretwave::solve {

namespace {

constexpr PetscInt redundant_limit = 2000;  // unknowns: below, every rank factorises the whole matrix
// Unknowns above which the Krylov route is the quicker one where the problem has a preconditioner: on reduced
// blades of 30 to 155 dofs it took half the time of a direct Newton step at 213 unknowns, a third at 708, a
// twelfth at 2328.
constexpr PetscInt krylov_limit = 300;
constexpr double tangent_tolerance = 1e-10;  // relative; of the tangent's direction
constexpr double tangent_accepted = 1e-6;    // where rounding lets GMRES go no further

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

KSP ksp_of(SNES snes) {
  KSP ksp;
  check(SNESGetKSP(snes, &ksp));
  return ksp;
}

bool is_direct(KSP ksp) {
  PetscBool direct;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(ksp), KSPPREONLY, &direct));
  return direct;
}

bool is_gmres(KSP ksp) {
  PetscBool gmres;
  check(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(ksp), &gmres, KSPGMRES, KSPFGMRES, KSPLGMRES,
                                  ""));
  return gmres;
}

bool on_any_rank(bool here, MPI_Comm comm) {
  int any = here;
  MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPI_INT, MPI_MAX, comm);
  return any;
}

}  // namespace

LinearSolver::LinearSolver(Bordered& bordered, std::string const& prefix, SNES snes)
    : bordered_(bordered), snes_(snes), point_(bordered.problem().unknowns()) {
  choose_route(prefix);
  preconditioner_ ? use_krylov() : use_direct();
}

void LinearSolver::choose_route(std::string const& prefix) {
  PetscInt unknowns;
  check(VecGetSize(point_, &unknowns));
  const std::string wish = choice(prefix, "-route", "route of the corrector", "direct", "krylov");
  const std::string blocks = choice(prefix, "-blocks", "kind of preconditioner", "dense", "sparse");
  if (wish == "krylov" || (wish == "auto" && unknowns > krylov_limit))
    preconditioner_ = bordered_.problem().preconditioner(blocks);
  const bool refused = wish == "krylov" && !preconditioner_;
  route_ = std::string(preconditioner_ ? "krylov" : "direct") + " (" +
           (refused          ? "krylov asked for, but this problem has no preconditioner"
            : wish == "auto" ? std::to_string(unknowns) + " unknowns"
                             : "asked for") +
           ")";
}

std::string LinearSolver::route() const {
  return route_ + (preconditioner_ ? ", " + preconditioner_->describe() : "");
}

void LinearSolver::use_direct() {
  KSP ksp = ksp_of(snes_);
  PC pc;
  PetscBool dense;
  PetscInt rows;
  J_ = bordered_.matrix();
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
  give_mumps_room(ksp);
}

/// Pivoting of nearly dense harmonic blocks outgrows MUMPS' own estimate of its workspace (+35 %), which ends
/// in a failed step.
void LinearSolver::give_mumps_room(KSP ksp) {
  PC pc;
  Mat factor;
  MatSolverType solver = nullptr;
  PetscBool lu, mumps;
  check(KSPGetPC(ksp, &pc));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCLU, &lu));
  if (lu) check(PCFactorGetMatSolverType(pc, &solver));
  check(PetscStrcmp(solver, MATSOLVERMUMPS, &mumps));
  if (!mumps) return;
  check(KSPSetOperators(ksp, J_, J_));
  check(PCFactorSetUpMatSolverType(pc));
  check(PCFactorGetMatrix(pc, &factor));
  check(MatMumpsSetIcntl(factor, 14, 200));
}

void LinearSolver::use_krylov() {
  KSP ksp = ksp_of(snes_);
  PC pc;
  const PetscInt local = local_size(point_);
  check(MatCreateShell(bordered_.problem().comm(), local, local, PETSC_DETERMINE, PETSC_DETERMINE, this,
                       J_.out()));
  check(MatShellSetOperation(J_, MATOP_MULT, reinterpret_cast<void (*)(void)>(shell_product)));
  check(KSPSetType(ksp, KSPFGMRES));
  check(KSPGMRESSetRestart(ksp, 100));
  check(KSPSetTolerances(ksp, 1e-6, 1e-13, PETSC_DEFAULT, 200));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCSHELL));
  check(PCShellSetContext(pc, this));
  check(PCShellSetApply(pc, shell_precondition));
}

void LinearSolver::make_tangent(std::string const& prefix) {
  KSP newton = ksp_of(snes_);
  PC pc;
  PetscInt iterations, restart;
  check(KSPGetPC(newton, &pc));
  check(KSPGetTolerances(newton, nullptr, nullptr, nullptr, &iterations));
  check(KSPCreate(bordered_.problem().comm(), tangent_.out()));
  check(KSPSetOptionsPrefix(tangent_, (prefix + "tangent_").c_str()));
  check(KSPSetPC(tangent_, pc));
  check(KSPSetType(tangent_, is_direct(newton) ? KSPPREONLY : KSPFGMRES));
  if (is_gmres(newton)) {
    check(KSPGMRESGetRestart(newton, &restart));
    check(KSPGMRESSetRestart(tangent_, restart));
  }
  check(KSPSetTolerances(tangent_, tangent_tolerance, PETSC_DEFAULT, PETSC_DEFAULT, iterations));
  check(KSPSetFromOptions(tangent_));
}

PetscErrorCode LinearSolver::shell_product(Mat J, Vec x, Vec y) {
  LinearSolver* solver;
  PetscErrorCode code = MatShellGetContext(J, &solver);
  if (code) return code;
  return solver->guard_.run([&] { solver->bordered_.product(solver->point_, x, y); });
}

PetscErrorCode LinearSolver::shell_precondition(PC pc, Vec x, Vec y) {
  LinearSolver* solver;
  PetscErrorCode code = PCShellGetContext(pc, &solver);
  if (code) return code;
  return solver->guard_.run([&] { solver->preconditioner_->apply(x, y); });
}

/// The preconditioner is stale once the iterations of Newton's solves beyond those just after it was built
/// have cost as much as building; at once, if even its first reuse cost more the last time.
void LinearSolver::count_iterations() {
  PetscInt iterations = 0;
  check(KSPGetIterationNumber(ksp_of(snes_), &iterations));
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

bool LinearSolver::linearise(Vec y, bool newton) {
  if (!preconditioner_) {
    bordered_.assemble(y, J_);
    return factorise();
  }
  check(VecCopy(y, point_));
  if (uncounted_ && !stale_) count_iterations();
  if (stale_) {
    preconditioner_->build(point_, bordered_.row());
    stale_ = false;
    fresh_ = -1, excess_ = 0;
  }
  uncounted_ = newton;
  check(MatAssemblyBegin(J_, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(J_, MAT_FINAL_ASSEMBLY));
  return true;
}

/// Factors of J, here and not inside a solve: the wrappers of LAPACK and KLU raise an error at a zero pivot,
/// after which nothing but a reset is safe. MUMPS' tells it by PCGetFailedReason.
bool LinearSolver::factorise() {
  KSP ksp = ksp_of(snes_);
  PC pc;
  PCFailedReason failed = PC_NOERROR;
  check(KSPSetOperators(ksp, J_, J_));
  const PetscErrorCode code = KSPSetUp(ksp);
  const bool singular = code == PETSC_ERR_MAT_LU_ZRPVT || code == PETSC_ERR_LIB;
  if (!singular) check(code);
  check(KSPGetPC(ksp, &pc));
  if (!singular) check(PCGetFailedReason(pc, &failed));
  if (!on_any_rank(singular || failed != PC_NOERROR, bordered_.problem().comm())) return true;
  check(KSPReset(ksp));
  check(KSPReset(tangent_));
  check(PCSetFailedReason(pc, PC_NOERROR));
  give_mumps_room(ksp);
  return false;
}

double LinearSolver::last_reduction() const {
  KSP ksp = ksp_of(snes_);
  Vec b;
  double left, size;
  if (is_direct(ksp)) return 0;
  check(KSPGetRhs(ksp, &b));
  check(KSPGetResidualNorm(ksp, &left));
  check(VecNorm(b, NORM_2, &size));
  return left / size;
}

/// Behind a kink of the branch the last tangent can be a guess so bad that GMRES takes it for divergence.
bool LinearSolver::solve(Vec b, Vec x) {
  if (solve_once(b, x)) return true;
  if (!preconditioner_) return false;
  check(VecSet(x, 0));
  return solve_once(b, x);
}

bool LinearSolver::solve_once(Vec b, Vec x) {
  KSPConvergedReason reason;
  double left, size;
  check(KSPSetOperators(tangent_, J_, J_));
  check(KSPSetInitialGuessNonzero(tangent_, is_direct(tangent_) ? PETSC_FALSE : PETSC_TRUE));
  const PetscErrorCode code = KSPSolve(tangent_, b, x);
  guard_.rethrow();
  check(code);
  check(KSPGetConvergedReason(tangent_, &reason));
  if (reason > 0) return true;
  if (reason == KSP_DIVERGED_NANORINF || reason == KSP_DIVERGED_PC_FAILED) return false;
  check(KSPGetResidualNorm(tangent_, &left));
  check(VecNorm(b, NORM_2, &size));
  return left <= tangent_accepted * size;
}

}  // namespace fretwave::solve
