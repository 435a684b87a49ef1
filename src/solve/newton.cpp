#include "solve/newton.h"

#include <algorithm>
#include <cmath>

#include "solve/vectors.h"
#include "tuned.h"

namespace fretwave::solve {

namespace {

#if PETSC_VERSION_GE(3, 24, 0)
constexpr char const* by_secant = SNESLINESEARCHSECANT;
#else
constexpr char const* by_secant = SNESLINESEARCHL2;
#endif

const Tuned smallest_step("newton_smallest_step", 1e-13,
                          "Newton step that is rounding, relative to the unknowns");
const Tuned stagnant_step("newton_stagnant_step", 1e-8,
                          "Newton step that the residual does not follow any more, relative to the unknowns");
const Tuned near("newton_near", 100, "residual next to its rounding, in multiples of that");
const Tuned plain("newton_plain", 1e-3,
                  "residual over the tolerance below which what rounding may hide does not count");
const Tuned small_effect("newton_small_effect", 1e-8,
                         "relative change of frequency and damping that a step may leave");
const Tuned largest_effect("newton_largest_effect", 1e-6,
                           "the change it may leave where rounding lets the residual fall no further");
const Tuned roughest("newton_roughest", 1e-4, "residual to which a tangent is solved at the least", 1);
const Tuned far("newton_far", 1e5, "step over residual from which the Jacobian is nearly singular");
const Tuned patience("newton_patience", 10,
                     "iterations after which a residual below the tolerance is enough");
const Tuned falling("newton_falling", 0.1,
                    "effect of a step over that of the one before, up to which it is not rounding's");
const Tuned unrefined(
    "newton_unrefined", 0.1,
    "effect by which the first of these is measured: what moves a point far is no refinement");
const Tuned creeping("newton_creeping", 0.6,
                     "share of the residual that four iterations leave when they creep");
const Tuned few_digits("newton_few_digits", 1e-4,
                       "residual over the guess's, where a few digits are asked for");
const Tuned rescalings("newton_rescalings", 4, "rescalings of the rows as the motion becomes known");

}  // namespace

Newton::Newton(Problem& problem, std::string const& prefix, bool past_kinks)
    : bordered_(problem), past_kinks_(past_kinks) {
  VecHandle y = problem.unknowns();
  right_side_ = like(y);
  check(SNESCreate(problem.comm(), snes_.out()));
  check(SNESSetOptionsPrefix(snes_, prefix.c_str()));
  check(SNESSetFunction(snes_, nullptr, form_function, this));
  // The residual is dimensionless (hb::HarmonicProblem), so one absolute tolerance serves every case.
  check(SNESSetTolerances(snes_, 1e-10, 1e-50, 0, 25, 1000));
  check(SNESSetConvergenceTest(snes_, converged, this, nullptr));
  linear_ = std::make_unique<LinearSolver>(bordered_, prefix, snes_);
  check(SNESSetJacobian(snes_, linear_->jacobian(), linear_->jacobian(), form_jacobian, this));
  check(SNESSetSolution(snes_, y));
  SNESLineSearch search;
  check(SNESGetLineSearch(snes_, &search));
  check(SNESLineSearchSetPreCheck(search, shorten, this));
  check(SNESSetFromOptions(snes_));
  linear_->take_options();
}

/// A step of a nearly singular Jacobian may lead where no line search comes back from.
PetscErrorCode Newton::shorten(SNESLineSearch, Vec y, Vec step, PetscBool* changed, void* context) {
  auto& newton = *static_cast<Newton*>(context);
  return newton.linear_->guard().run([&] {
    const double share = newton.bordered_.problem().bearable(y, step);
    if (*changed = share < 1 ? PETSC_TRUE : PETSC_FALSE; share < 1) check(VecScale(step, share));
  });
}

/// PETSc's test, but for a guess that passes it: a step's cost buys the digits that a small damping needs.
PetscErrorCode Newton::converged(SNES snes, PetscInt iteration, PetscReal unknowns, PetscReal step,
                                 PetscReal residual, SNESConvergedReason* reason, void* context) {
  auto& newton = *static_cast<Newton*>(context);
  const double before = newton.last_[(iteration + newton.last_.size() - 1) % newton.last_.size()];
  newton.step_from_ = iteration == 0 ? residual : before;
  if (iteration == 0) newton.began_from_ = residual;
  newton.left_.reset();
  if (iteration > 0 && before > 0) newton.left_ = residual / before;
  const bool creeps = newton.creeps(iteration, residual);
  PetscErrorCode code = SNESConvergedDefault(snes, iteration, unknowns, step, residual, reason, nullptr);
  if (code || *reason < 0) return code;
  if (iteration == 0) {
    if (*reason > 0 && residual > 0) *reason = SNES_CONVERGED_ITERATING;
    return code;
  }
  if (newton.effort_ == Effort::rough && residual <= few_digits * newton.began_from_) {
    *reason = SNES_CONVERGED_FNORM_RELATIVE;
    return code;
  }
  Vec y;
  code = SNESGetSolution(snes, &y);
  if (code) return code;
  return newton.linear_->guard().run([&] {
    if (*reason == 0) {
      *reason = newton.judge(y, std::max(unknowns, 1.0), step, residual, before);
      if (*reason == 0 && creeps) *reason = SNES_DIVERGED_MAX_IT;
    } else if (newton.linear_->hurried() || (iteration < patience && newton.matters(y, residual, before))) {
      *reason = SNES_CONVERGED_ITERATING;
    }
  });
}

/// Whether the iterations are better spent on a nearer guess.
bool Newton::creeps(int iteration, double residual) {
  const double before = std::exchange(last_[iteration % last_.size()], residual);
  return effort_ == Effort::brief && iteration >= int(last_.size()) && residual > creeping * before;
}

/// Whether what a residual below its tolerance leaves shows in what is read from the point (the damping at
/// first slip is as small as that), and another step can take it away. What is left of the residual lies in
/// other equations than what the step took, and may count for more.
bool Newton::matters(Vec y, double residual, double before) {
  return last_effect(y) * std::sqrt(std::min(1.0, residual / before)) > small_effect &&
         residual > bordered_.problem().rounding(y);
}

bool Newton::below_tolerance(double residual, double share) const {
  double tolerance;
  check(SNESGetTolerances(snes_, &tolerance, nullptr, nullptr, nullptr, nullptr));
  return residual <= share * tolerance;
}

/// Above the tolerance. A residual or a full step at rounding level ends the iteration, and a small step
/// under which a residual near that level no longer halves: it cannot fall further. So it is where forces
/// cancel that are far above those measured with (a stiff contact under preload at a small amplitude, the
/// element forces of a fine mesh). What is left must not matter to what is read from the point.
SNESConvergedReason Newton::judge(Vec y, double unknowns, double step, double residual, double before) {
  const double rounding = bordered_.problem().rounding(y);
  SNESLineSearch search;
  PetscReal fraction;
  check(SNESGetLineSearch(snes_, &search));
  check(SNESLineSearchGetLambda(search, &fraction));
  if (std::max(residual, rounding) > bordered_.problem().largest_residual()) return SNES_CONVERGED_ITERATING;
  const bool halves = residual <= 0.5 * before;
  if (residual <= rounding && halves && last_effect(y) * residual / before <= small_effect)
    return SNES_CONVERGED_FNORM_ABS;
  const bool stagnates = !halves && residual <= near * rounding && step <= stagnant_step * unknowns;
  const bool tiny = step <= smallest_step * unknowns && fraction == 1;
  if ((stagnates || tiny) && last_effect(y) <= largest_effect * fraction)
    return SNES_CONVERGED_SNORM_RELATIVE;
  return SNES_CONVERGED_ITERATING;
}

/// Of the last step on what is read from the point.
double Newton::last_effect(Vec y) {
  Vec step;
  check(SNESGetSolutionUpdate(snes_, &step));
  return bordered_.problem().effect(y, step);
}

/// The line search found nothing lower along a step this small: rounding, as in `judge`, or a guess that
/// GMRES finds nothing to do at.
bool Newton::stuck_at_rounding(Vec y) {
  Vec step;
  double length, unknowns, residual;
  const double rounding = bordered_.problem().rounding(y);
  check(SNESGetSolutionUpdate(snes_, &step));
  check(SNESGetFunctionNorm(snes_, &residual));
  check(VecNorm(step, NORM_2, &length));
  check(VecNorm(y, NORM_2, &unknowns));
  return std::max(residual, rounding) <= bordered_.problem().largest_residual() &&
         length <= stagnant_step * std::max(unknowns, 1.0) &&
         (residual <= near * rounding || below_tolerance(residual, plain)) &&
         last_effect(y) <= largest_effect;
}

PetscErrorCode Newton::form_function(SNES, Vec y, Vec g, void* context) {
  auto& newton = *static_cast<Newton*>(context);
  return newton.linear_->guard().run([&] { newton.bordered_.residual(y, g); });
}

/// Where six digits end in the tolerance or in rounding they may end the iteration, and next to rounding they
/// do: no step is foretold there.
void Newton::aim(Vec y) {
  double residual, tolerance;
  check(SNESGetFunctionNorm(snes_, &residual));
  check(SNESGetTolerances(snes_, &tolerance, nullptr, nullptr, nullptr, nullptr));
  const double rounding = bordered_.problem().rounding(y),
               before = residual <= near * rounding ? 0 : step_from_;
  linear_->aim(residual, before, std::max(tolerance, rounding));
}

PetscErrorCode Newton::form_jacobian(SNES snes, Vec y, Mat, Mat, void* context) {
  auto& newton = *static_cast<Newton*>(context);
  return newton.linear_->guard().run([&] {
    const bool regular = newton.linear_->linearise(y, true, newton.left_);
    if (newton.linear_->aims()) newton.aim(y);
    check(
        SNESSetCheckJacobianDomainError(snes, regular ? PETSC_FALSE : PETSC_TRUE));  // it is never taken back
    if (!regular) check(SNESSetJacobianDomainError(snes));
  });
}

bool Newton::scale(Vec y) {
  if (!bordered_.problem().scale(y)) return false;
  linear_->renew();
  return true;
}

/// The rows are measured in the forces that act at y: those of the guess first, those of the solution once it
/// is known.
Outcome Newton::solve(Vec y, Effort effort) {
  Outcome out;
  effort_ = effort;
  const bool roughly = effort == Effort::rough;
  scale(y);
  for (int k = 0; k < rescalings; ++k) {
    const Outcome before = std::exchange(out, solve_past_kinks(y));
    out.newton += before.newton, out.linear += before.linear;
    if (!out.converged || roughly || !scale(y)) break;
  }
  if (out.converged && !roughly) refine(y, out);
  return out;
}

/// Rounding is that of the largest forces, of stiff pairs and static loads: it hides what is left of the
/// others' residual, and no line search sees it fall. Full steps are taken there as long as their effects
/// fall; where rounding is above the tolerance, as a fine mesh's, on the direct route alone, where they are
/// cheap.
void Newton::refine(Vec y, Outcome& out) {
  const double most = (out.accepted ? 1.0 : linear_->krylov() ? 0.0 : near) * out.rounding;
  if (below_tolerance(out.residual, plain) || out.residual > most) return;
  VecHandle g = like(right_side_), step = zero_like(y);
  bordered_.residual(y, g);
  for (double last = unrefined; last > small_effect && linear(y, g, step);) {
    const double effect = bordered_.problem().effect(y, step);
    const VecHandle there = moved(y, -1, step);
    bordered_.residual(there, g);
    const double residual = norm(g);
    if (!(effect <= falling * last && residual <= std::max(out.residual, out.rounding))) return;
    check(VecCopy(there, y));
    last = effect, out.residual = residual, ++out.newton, ++out.refined;
  }
}

Outcome Newton::as_it_stands(Vec y) {
  Outcome out;
  bordered_.residual(y, right_side_);
  out.residual = norm(right_side_);
  out.rounding = std::isfinite(out.residual) ? bordered_.problem().rounding(y) : 0;
  out.accepted = below_tolerance(out.residual, plain);
  out.converged = out.accepted || out.residual <= out.rounding;
  return out;
}

/// At a kink every shortened step raises the residual until the samples behind it have changed state:
/// backtracking ends there, a search by the secant of |r|^2 goes through. Tried from the same guess.
Outcome Newton::solve_past_kinks(Vec y) {
  SNESLineSearch search;
  PetscBool backtracks;
  VecHandle guess = like(y);
  check(VecCopy(y, guess));
  Outcome out = solve_persistently(y);
  check(SNESGetLineSearch(snes_, &search));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(search), SNESLINESEARCHBT, &backtracks));
  if (!past_kinks_ || effort_ < Effort::full || out.converged || out.linear_failure || !backtracks ||
      !std::isfinite(out.residual))
    return out;
  check(VecCopy(guess, y));
  check(SNESLineSearchSetType(search, by_secant));
  const Outcome before = std::exchange(out, solve_persistently(y));
  check(SNESLineSearchSetType(search, SNESLINESEARCHBT));
  out.newton += before.newton, out.linear += before.linear;
  return out;
}

/// A linear solve that fails is tried again from the last iterate in dearer ways.
Outcome Newton::solve_persistently(Vec y) {
  Outcome out = solve_once(y);
  while (out.linear_failure && linear_->climb()) {
    const Outcome before = std::exchange(out, solve_once(y));
    out.newton += before.newton, out.linear += before.linear;
  }
  if (out.converged) linear_->descend();
  if (!out.converged && !out.linear_failure) out.reason += explain_step(y);
  if (out.linear_failure && !linear_->fallbacks().said.empty())
    out.reason += " (" + linear_->fallbacks().said + ")";
  return out;
}

/// Of a step that the residual it began from does not account for: J is nearly singular, and no line search
/// shortens it to use.
std::string Newton::explain_step(Vec y) {
  Vec step;
  SNESConvergedReason reason;
  double length, residual;
  check(SNESGetSolutionUpdate(snes_, &step));
  if (!step) return {};
  check(VecNorm(step, NORM_2, &length));
  check(SNESGetConvergedReason(snes_, &reason));
  check(SNESGetFunctionNorm(snes_, &residual));
  if (reason != SNES_DIVERGED_LINE_SEARCH) residual = step_from_;  // the step was taken
  if (!(length > far * residual)) return {};
  const std::string why = bordered_.problem().explain(y, step);
  return why.empty() ? why : " (" + why + ")";
}

Outcome Newton::solve_once(Vec y) {
  linear_->guard().clear();
  const PetscErrorCode code = SNESSolve(snes_, nullptr, y);
  linear_->guard().rethrow();
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
  const bool singular = reason == SNES_DIVERGED_JACOBIAN_DOMAIN;
  if (reason == SNES_DIVERGED_LINE_SEARCH && stuck_at_rounding(y)) reason = SNES_CONVERGED_SNORM_RELATIVE;
  if (reason < 0) linear_->renew();
  return {reason > 0,
          int(newton),
          int(linear),
          norm,
          singular ? "the Jacobian is singular" : text,
          reason > 0 && below_tolerance(norm),
          std::isfinite(norm) ? bordered_.problem().rounding(y) : 0,
          singular || reason == SNES_DIVERGED_LINEAR_SOLVE};
}

/// Of the residual at y; 0 where it is not known, or no iteration asks for it. A tangent needs four digits
/// even where the residual has fewer. (Newton's steps go below it: what rounds are stiff directions, and soft
/// ones have digits left.)
double Newton::rounding(Vec y) {
  const double residual = linear_->krylov() ? bordered_.problem().rounding(y) : 0;
  return std::isfinite(residual) ? std::min<double>(residual, roughest) : 0;
}

bool Newton::tangent(Vec y, Vec t, bool exactly) {
  check(VecSet(right_side_, 0));
  set_last_entry(right_side_, 1);
  // about as long as y: its product with the Jacobian is rounded as the residual is
  const Vec b = right_side_;
  return linear(y, {&b, 1}, {&t, 1}, rounding(y), exactly ? 0 : linear_->rough());
}

bool Newton::linear(Vec y, Vec b, Vec x) { return linear(y, {&b, 1}, {&x, 1}); }

bool Newton::linear(Vec y, std::span<Vec const> b, std::span<Vec const> x, double rounding, double share) {
  const auto all = [&] {
    for (size_t k = 0; k < b.size(); ++k)
      if (!linear_->solve(b[k], x[k], rounding, share)) return false;
    return true;
  };
  do {
    if (linear_->linearise(y, false) && all()) return true;
  } while (linear_->climb());
  return false;
}

}  // namespace fretwave::solve
