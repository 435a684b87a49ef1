#include "solve/linear_solver.h"

#include <algorithm>

#include "error.h"
#include "solve/direct.h"
#include "solve/vectors.h"
#include "tuned.h"

namespace fretwave::solve {

namespace {

// Unknowns above which the Krylov route is the quicker one where the problem has a preconditioner: on reduced
// blades of 30 to 155 dofs it took half the time of a direct Newton step at 213 unknowns, a third at 708, a
// twelfth at 2328.
const Tuned krylov_limit("linear_krylov_limit", 300, "unknowns above which the Krylov route is taken");
constexpr double tangent_tolerance = 1e-10;  // relative; of the tangent's direction
const Tuned large("linear_large", 3e4,
                  "unknowns above which steps far from a solution, and tangents, are solved to fewer digits");
// Predictors through near points enlarge it: with 1e-4 of 768 pairs a branch of 11 points took 28.
const Tuned rough_tangent("linear_rough_tangent", 1e-7,
                          "relative residual of tangents of large problems that steps are taken along", 1);
const Tuned tangent_accepted("linear_tangent_accepted", 1e-6,
                             "residual of a tangent, relative, where rounding lets GMRES go no further", 1);

/// Our options under the prefix, where PETSc's -help is given; its macros return its error codes.
PetscErrorCode offered(MPI_Comm comm, std::string const& prefix) {
  char wish[32] = "auto", blocks[32] = "auto";
  PetscOptionsBegin(comm, prefix.c_str(), "fretwave: linear systems", "fretwave");
  PetscErrorCode code = PetscOptionsString("-route", "route of the corrector: auto, direct or krylov",
                                           "fretwave", wish, wish, sizeof wish, nullptr);
  if (!code)
    code = PetscOptionsString("-blocks", "kind of preconditioner: auto, dense or sparse", "fretwave", blocks,
                              blocks, sizeof blocks, nullptr);
  if (code) return code;
  PetscOptionsEnd();
  return PetscErrorCode(0);
}

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

}  // namespace

LinearSolver::LinearSolver(Bordered& bordered, std::string const& prefix, SNES snes)
    : bordered_(bordered),
      prefix_(prefix),
      snes_(snes),
      point_(bordered.problem().unknowns()),
      served_(like(point_)) {
  choose_route();
  if (krylov_) {
    use_krylov();
    return;
  }
  J_ = bordered_.matrix();
  use_lu(newton_ksp(), J_);
}

KSP LinearSolver::newton_ksp() const {
  KSP ksp;
  check(SNESGetKSP(snes_, &ksp));
  return ksp;
}

/// Others may hold the SNES, and view it.
LinearSolver::~LinearSolver() {
  if (krylov_ && J_) (void)MatShellSetContext(J_, nullptr);
}

void LinearSolver::choose_route() {
  const PetscInt unknowns = this->unknowns();
  const std::string wish = choice(prefix_, "-route", "route of the corrector", "direct", "krylov");
  const std::string blocks = choice(prefix_, "-blocks", "kind of preconditioner", "dense", "sparse");
  if (wish == "krylov" || (wish == "auto" && unknowns > krylov_limit)) {
    kind_.kind = blocks == "auto" ? asked_kind() : nullptr;
    if (!kind_.kind) kind_ = choose_kind(bordered_.problem(), blocks);
  }
  krylov_ = kind_.kind;
  const bool refused = wish == "krylov" && !krylov_;
  route_ = std::string(krylov_ ? "krylov" : "direct") + " (" +
           (refused          ? "krylov asked for, but this problem has no preconditioner"
            : wish == "auto" ? std::to_string(unknowns) + " unknowns"
                             : "asked for") +
           ")" + (krylov_ ? "" : kind_.note);
}

/// The kind that -<prefix>pc_type asks for, so that no other is looked for; null if the problem cannot have
/// it.
PreconditionerKind const* LinearSolver::asked_kind() {
  char given[32] = "";
  check(PetscOptionsGetString(nullptr, prefix_.c_str(), "-pc_type", given, sizeof given, nullptr));
  auto const* kind = kind_of(given);
  return kind && refusal(*kind, bordered_.problem()).empty() ? kind : nullptr;
}

std::string LinearSolver::route() const { return route_ + (own_ ? ", " + own_->describe() + note_ : ""); }

std::string LinearSolver::description() const {
  return fallback_ ? fallback_->describe() : own_ ? own_->describe() + note_ : "not made yet";
}

void LinearSolver::use_krylov() {
  KSP ksp = newton_ksp();
  PC pc;
  const PetscInt local = local_size(point_);
  check(MatCreateShell(bordered_.problem().comm(), local, local, PETSC_DETERMINE, PETSC_DETERMINE, this,
                       J_.out()));
  check(MatShellSetOperation(J_, MATOP_MULT, reinterpret_cast<void (*)(void)>(shell_product)));
  check(MatShellSetOperation(J_, MATOP_MULT_TRANSPOSE,
                             reinterpret_cast<void (*)(void)>(shell_transposed_product)));
  check(KSPSetType(ksp, KSPFGMRES));
  check(KSPGMRESSetRestart(ksp, 100));
  // Six digits: with fewer a count of GMRES that rounding turns changes the step, and a hard branch has other
  // points on other numbers of ranks. Large problems save half of all iterations by them (`aim`).
  check(KSPSetTolerances(ksp, digits, 1e-13, PETSC_DEFAULT, 200));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, kind_.kind->type.c_str()));
}

void LinearSolver::take_options() {
  check(offered(bordered_.problem().comm(), prefix_));
  Tuned::help(bordered_.problem().comm());
  const bool is_large = krylov_ && unknowns() > large;
  aims_ = is_large && !given({"-ksp_rtol", "-snes_ksp_ew"});
  rough_ = is_large && !given({"-tangent_ksp_rtol"}) ? double(rough_tangent) : 0;
  make_preconditioner();
  make_tangent();
}

/// Of the kind that -<prefix>pc_type asks for, or of the one that was chosen.
void LinearSolver::make_preconditioner() {
  PC pc;
  PCType type;
  check(KSPGetPC(newton_ksp(), &pc));
  check(PCGetType(pc, &type));
  auto const* kind = type ? kind_of(type) : nullptr;
  if (!kind) return;
  if (!krylov_)
    throw InputError("option pc_type: the direct route takes no " + kind->type + kind_.note, kind->type,
                     "the Krylov route", "ask for it: -<analysis>_route krylov");
  if (kind == kind_.kind)
    note_ = kind_.note;
  else if (const auto why = refusal(*kind, bordered_.problem()); !why.empty())
    throw InputError("option pc_type: there is no " + kind->type + " for " + why, kind->type,
                     kind_.kind->type, "leave out the option -<analysis>_pc_type");
  kind_.kind = kind;
  own_ = kind->make(bordered_.problem());
}

void LinearSolver::make_tangent() {
  KSP newton = newton_ksp();
  PC pc;
  PetscInt iterations, restart;
  check(KSPGetPC(newton, &pc));
  check(KSPGetTolerances(newton, nullptr, nullptr, nullptr, &iterations));
  check(KSPCreate(bordered_.problem().comm(), tangent_.out()));
  check(KSPSetOptionsPrefix(tangent_, (prefix_ + "tangent_").c_str()));
  check(KSPSetPC(tangent_, pc));
  check(KSPSetType(tangent_, is_direct(newton) ? KSPPREONLY : KSPFGMRES));
  if (is_gmres(newton)) {
    check(KSPGMRESGetRestart(newton, &restart));
    check(KSPGMRESSetRestart(tangent_, restart));
  }
  check(KSPSetTolerances(tangent_, tangent_tolerance, PETSC_DEFAULT, PETSC_DEFAULT, iterations));
  check(KSPSetFromOptions(tangent_));
  check(KSPGetTolerances(tangent_, &tangent_least_, &tangent_floor_, nullptr, nullptr));
}

/// Whether PETSc's options have one of these, under the prefix.
bool LinearSolver::given(std::initializer_list<char const*> options) const {
  return std::ranges::any_of(options, [&](char const* option) {
    PetscBool found;
    check(PetscOptionsHasName(nullptr, prefix_.c_str(), option, &found));
    return found == PETSC_TRUE;
  });
}

PetscErrorCode LinearSolver::shell_product(Mat J, Vec x, Vec y) {
  LinearSolver* solver;
  PetscErrorCode code = MatShellGetContext(J, &solver);
  if (code) return code;
  return solver->guard_.run([&] { solver->bordered_.product(solver->point_, x, y); });
}

PetscErrorCode LinearSolver::shell_transposed_product(Mat J, Vec x, Vec y) {
  LinearSolver* solver;
  PetscErrorCode code = MatShellGetContext(J, &solver);
  if (code) return code;
  return solver->guard_.run([&] { solver->bordered_.transposed_product(solver->point_, x, y); });
}

PetscErrorCode LinearSolver::refuse_transpose() {
  return guard_.run([&] {
    throw InputError("the preconditioner " + kind_.kind->type + " has no transpose", kind_.kind->type,
                     "a PC with a transpose, as none, or a KSP that needs none, as fgmres",
                     "give -<analysis>_pc_type none, or leave out -<analysis>_ksp_type");
  });
}

PetscErrorCode LinearSolver::apply(Vec x, Vec z) {
  if (!own_) return PETSC_ERR_ARG_WRONGSTATE;
  return guard_.run([&] { preconditioner().apply(x, z); });
}

bool LinearSolver::linearise(Vec y, bool newton, std::optional<double> left) {
  if (!krylov_) {
    bordered_.assemble(y, J_);
    if (factorise(newton_ksp(), J_)) return true;
    check(KSPReset(tangent_));
    return false;
  }
  if (left) set_reach(y, *left);
  check(VecCopy(y, point_));
  if (uncounted_ && !stale_) count_iterations();
  uncounted_ = false;
  check(MatAssemblyBegin(J_, MAT_FINAL_ASSEMBLY));  // another state, for which PCSetUp looks
  check(MatAssemblyEnd(J_, MAT_FINAL_ASSEMBLY));
  if (own_ && !set_up()) return false;
  uncounted_ = own_ && (newton || beside_);
  return true;
}

void LinearSolver::serve_beside(double tolerance) {
  beside_ = true;
  check(KSPSetTolerances(tangent_, tolerance, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  check(KSPSetFromOptions(tangent_));
  check(KSPGetTolerances(tangent_, &tangent_least_, nullptr, nullptr, nullptr));
}

PetscInt LinearSolver::unknowns() const { return global_size(point_); }

/// Behind a kink of the branch the last tangent can be a guess so bad that GMRES takes it for divergence.
bool LinearSolver::solve(Vec b, Vec x, double rounding, double share) {
  check(KSPSetTolerances(tangent_, std::max(share, tangent_least_), std::max(rounding, tangent_floor_),
                         PETSC_DEFAULT, PETSC_DEFAULT));
  if (solve_once(b, x)) return true;
  if (!krylov_) return false;
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
