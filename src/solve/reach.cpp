/// The branch at a value of its parameter inside a step: reports, and the ends of the range.
#include <algorithm>
#include <cmath>

#include "solve/continuation.h"

namespace fretwave::solve {

namespace {

constexpr int looks = 40;          // for where a guess passes a parameter
constexpr double polished = 1e-6;  // arclength: a step farther than that is no polish
constexpr int tries = 16;          // of points on the way to a value where Newton fails

}  // namespace

/// Where guesses along the step pass a value of the parameter's entry, by bisection: just before it.
double Continuation::passing(std::function<VecHandle(double)> const& guess, double target, Place from,
                             double to) {
  double inside = from.at;
  for (int k = 0; k < looks; ++k) {
    const double middle = (inside + to) / 2;
    ((last_entry(guess(middle)) < target) == (from.value < target) ? inside : to) = middle;
  }
  return inside;
}

/// The branch at a given parameter between two places of the step.
void Continuation::reach(double value, std::string const& event, Place a, Place b, Hermite const& curve,
                         double length) {
  const double target = problem_.parameter_entry(value);
  std::string why;
  auto trial = at_value(target, a, b, curve, length, why);
  if (!trial) trial = reach_along(target, a, b, curve);
  if (!trial) trial = reach_by_steps(target, a, b, curve, why);
  if (!trial) {
    if (event == "report") miss("report at " + problem_.parameter_text(value), why);
    return;
  }
  polish(*trial, target);
  const double place = dot(row_, trial->y) - row_value_;
  emit(std::move(*trial), std::clamp(place, a.at, b.at), event);
}

/// Newton at a parameter from where a curve passes it; none, and why, where it fails or goes elsewhere.
std::optional<Continuation::Trial> Continuation::at_value(double target, Place a, Place b,
                                                          Hermite const& curve, double length,
                                                          std::string& why) {
  // on the cubic, which is as monotone as the branch but for rounding
  const auto on_curve = [&](double at) { return curve.value(at); };
  Trial trial = at(curve.value(passing(on_curve, target, a, b.at)));
  set_last_entry(trial.y, target);  // to the last digit, not to that of a linear solve
  const VecHandle expected = copy(trial.y);
  if (!correct(trial, parameter_row_, target, row_)) return why = trial.outcome.reason, std::nullopt;
  const double place = dot(row_, trial.y) - row_value_, slack = 0.05 * (b.at - a.at);
  if (place > a.at - slack && place < b.at + slack && distance(trial.y, expected) <= off_the_curve * length)
    return trial;
  return why = elsewhere, std::nullopt;
}

/// The same where Newton fails from the step's cubic, too long a one for where contacts change: from the
/// nearer end it is gone half the way to the value, or half of that, until Newton finds the branch there, and
/// on from the cubic through that point.
std::optional<Continuation::Trial> Continuation::reach_by_steps(double target, Place a, Place b,
                                                                Hermite const& curve, std::string& why) {
  std::vector<Trial> found;  // what the curve goes through
  found.reserve(tries);
  Hermite known = curve, through = curve;
  double share = 0.5;
  for (int k = 0; k < tries; ++k) {
    const auto on_curve = [&](double at) { return through.value(at); };
    const double goal = passing(on_curve, target, a, b.at);
    const double near = goal - a.at < b.at - goal ? a.at : b.at, place = near + share * (goal - near);
    if (std::abs(place - near) <= value_error * (b.at - a.at)) break;
    Trial trial = at(through.value(place));
    if (!correct_inside(trial, place, b.at - a.at)) {
      share /= 2;
      continue;
    }
    const Place here{place, last_entry(trial.y)};
    ((here.value < target) == (a.value < target) ? a : b) = here;
    found.push_back(std::move(trial));
    known = with(known, place, found.back().y, found.back().tangent);
    through = known.between(a.at, b.at);
    if (auto exact = at_value(target, a, b, through, b.at - a.at, why)) return exact;
    share = 0.5;
  }
  return {};
}

/// The same along the branch, where the corrector at a fixed parameter fails (beside a fold).
std::optional<Continuation::Trial> Continuation::reach_along(double target, Place a, Place b,
                                                             Hermite const& curve) {
  a.value -= target, b.value -= target;
  const double most = off_the_curve * (b.at - a.at);
  for (int k = 0; k < 60; ++k) {
    double at = secant(a, b);
    if (k % 3 == 2) at = (a.at + b.at) / 2;
    Trial trial = this->at(curve.value(at));
    if (!correct(trial, row_, row_value_ + at, row_)) return {};
    const double value = last_entry(trial.y) - target;
    if (std::abs(value) <= value_error * std::max(1.0, std::abs(target))) {
      Trial exact = this->at(copy(trial.y));
      set_last_entry(exact.y, target);
      const bool good = correct(exact, parameter_row_, target, row_) && distance(exact.y, trial.y) <= most;
      return good ? std::move(exact) : std::move(trial);
    }
    ((value < 0) == (a.value < 0) ? a : b) = {at, value};
  }
  return {};
}

/// One Newton step more: what is reported is as good as the corrector can make it, not just good enough. The
/// tangent does not feel so short a way. Of a large problem at rounding level it is a fifth of the point's
/// cost, and moves the frequency by no more than that rounding does (1e-10).
void Continuation::polish(Trial& trial, double target) {
  if (way_ || (newton_.aims() && trial.outcome.residual <= trial.outcome.rounding)) return;
  VecHandle better = copy(trial.y);
  check(SNESSetForceIteration(newton_.snes(), PETSC_TRUE));
  newton_.system().close(parameter_row_, target);
  Outcome outcome = newton_.solve(better);
  check(SNESSetForceIteration(newton_.snes(), PETSC_FALSE));
  // counted as the one step it is: at rounding level its line search ends where it likes
  const int newton = trial.outcome.newton + 1, linear = trial.outcome.linear + outcome.linear;
  const bool near = distance(better, trial.y) <= polished;  // not so where `reach_along` has refused it
  if (near && outcome.converged && outcome.residual <= trial.outcome.residual)
    trial.y = std::move(better), trial.outcome = std::move(outcome);
  trial.outcome.newton = newton, trial.outcome.linear = linear;
}

}  // namespace fretwave::solve
