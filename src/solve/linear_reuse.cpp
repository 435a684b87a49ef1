/// How well the Krylov route solves a step's system, and how long its preconditioner serves.
#include <algorithm>
#include <cmath>

#include "log.h"
#include "solve/linear_solver.h"
#include "solve/vectors.h"
#include "tuned.h"

namespace fretwave::solve {

namespace {

const Tuned roughly("linear_roughly", 1e-2, "relative residual of Newton steps far from a solution", 1);
constexpr double falls = 0.5;  // of a residual before: where it foretells another
const Tuned straight("linear_straight", 0.03,
                     "share of the residual that a step leaves, up to which the preconditioner stays");
const Tuned farther("linear_farther", 3, "how far it stays, over the length of that step, at the most");
const Tuned renewal("linear_renewal", 1.0 / 16,
                    "share of all iterations that is spent on building preconditioners anew");

}  // namespace

/// Far from a solution a step need not be better than its linearisation: Newton's quadratic convergence
/// foretells that (|g_k| / |g_k-1|)^2 is left of the residual (Eisenstat & Walker, SIAM J. Sci. Comput. 17,
/// 1996, choice 2). Where that may end the iteration, or six digits where nothing is foretold (at the guess,
/// or where the residual hardly falls), six it is: so it ends with as little left as ever. 768 pairs (34,725
/// unknowns) take half the iterations of GMRES and the same steps.
void LinearSolver::aim(double residual, double before, double enough) {
  const double foretold = residual < falls * before ? std::pow(residual / before, 2) : 0, least = digits,
               most = std::clamp(double(roughly), least, 0.5);
  aimed_at_ = residual * std::max(least, foretold) <= enough ? least
              : foretold > 0                                 ? std::clamp(foretold, least, most)
                                                             : most;
  check(KSPSetTolerances(newton_ksp(), aimed_at_, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
}

/// The preconditioner is stale once the iterations of Newton's solves beyond those just after it was built
/// have cost as much as building; at once, if even its first reuse cost more the last time. Built at a hard
/// point it would never be: a share of all iterations counts. Built for a tangent, it is no longer fresh when
/// Newton first solves with it: what the last one took when it was counts. Of solves to fewer digits their
/// share of six.
void LinearSolver::count_iterations() {
  PetscInt iterations = 0;
  check(KSPGetIterationNumber(beside_ ? KSP(tangent_) : newton_ksp(), &iterations));
  const double cost = preconditioner().build_cost(), share = std::log(aimed_at_) / std::log(digits),
               whole = iterations / share;
  if (fresh_ < 0 && built_here_) {
    fresh_ = last_fresh_ = whole;
    stale_ = first_reuse_ > cost;
    first_reuse_ /= 2;
    return;
  }
  if (fresh_ < 0) fresh_ = last_fresh_ < 0 ? whole : std::min(whole, last_fresh_);
  const double beyond = std::max(0.0, iterations - share * fresh_);
  if (excess_ == 0) first_reuse_ = beyond;
  excess_ += beyond + renewal * iterations;
  stale_ = excess_ > cost;
}

/// Here and not inside a solve, so that a singular block is a singular Jacobian.
bool LinearSolver::set_up() {
  PC pc;
  PCFailedReason reason;
  check(KSPGetPC(newton_ksp(), &pc));
  check(PCSetOperators(pc, J_, J_));
  check(PCSetReusePreconditioner(pc, PETSC_FALSE));  // what is kept is said here, not by SNES' lag
  const PetscErrorCode code = PCSetUp(pc);
  guard_.rethrow();
  check(code);
  check(PCGetFailedReason(pc, &reason));
  return reason == PC_NOERROR;
}

PetscErrorCode LinearSolver::set_up(PC pc) {
  if (!own_) return PETSC_ERR_ARG_WRONGSTATE;  // inside a PC of PETSc's
  return guard_.run([&] {
    if (!stale_ && !serves()) follow();
    built_here_ = stale_;
    check(PCSetFailedReason(pc, stale_ && !build() ? PC_FACTOR_NUMERIC_ZEROPIVOT : PC_NOERROR));
  });
}

/// What a step leaves of the residual is by how much the Jacobian has changed over it: it is next to the same
/// over so long a way, in multiples of that step. (Not from one such place to the next: of small steps each
/// would be.)
void LinearSolver::set_reach(Vec y, double left) {
  const double way = norm(moved(y, -1, point_)) * std::min(straight / left, double(farther));
  reach_ = left <= straight ? std::max(reach_, way) : -1;
}

bool LinearSolver::serves() const { return norm(moved(point_, -1, served_)) <= reach_; }

void LinearSolver::serve_from_here() {
  check(VecCopy(point_, served_));
  reach_ = 0;
}

void LinearSolver::follow() {
  static const log::Event following("FwPCFollow");
  const log::Span span(following);
  reach_ = -1;  // should it fail on the way
  try {
    preconditioner().follow(point_);
    serve_from_here();
  } catch (SingularBlock const&) {
    stale_ = true;  // what was followed in part is built anew
  }
}

bool LinearSolver::build() {
  static const log::Event building("FwPCBuild");
  const log::Span span(building);
  try {
    preconditioner().build(point_, bordered_.row());
  } catch (SingularBlock const&) {
    return false;
  }
  stale_ = false;
  fresh_ = -1, excess_ = 0;
  serve_from_here();
  return true;
}

}  // namespace fretwave::solve
