/// A zero of a test function inside a step.
#include <cmath>
#include <utility>

#include "solve/continuation.h"

namespace fretwave::solve {

namespace {

constexpr double jump = 0.1;       // of the end values: what is left where a test function jumps
constexpr double on_curve = 1e-9;  // of a bracket: so precisely a curve's zero is found
constexpr double near = 3e-3;  // of a step: what Newton leaves of trials so near to each other bends a curve
constexpr int looks = 30;      // at a curve
constexpr int smooth = 3;      // trials on cubics: if those do not close in the branch has a corner there
constexpr double off_zero = 10;  // times move apart^2: a cubic's zero, by its way from two trials
constexpr double closer = 0.1;   // of all trials before: what a value of one that closes in is at the most

}  // namespace

/// The Illinois form of regula falsi: the end kept twice in a row is given half its value.
class Continuation::Bracket {
 public:
  Bracket(Place a, Place b) : a_(a), b_(b) {}
  double width() const { return b_.at - a_.at; }
  double first() const { return a_.at; }
  double last() const { return b_.at; }
  bool holds(double at) const { return at >= a_.at && at <= b_.at; }
  double next() const {
    const double at = secant(a_, b_);
    return holds(at) ? at : a_.at;  // else both ends are of one sign
  }
  void narrow(Place place) {
    const bool behind = (place.value > 0) == (b_.value > 0);
    double& kept = (behind ? a_ : b_).value;
    const int side = behind ? +1 : -1;
    if (side == side_) kept /= 2;
    (behind ? b_ : a_) = place;
    side_ = side;
  }

 private:
  Place a_, b_;
  int side_ = 0;
};

/// Between two places, where the values of a test function on a curve differ in sign.
double Continuation::zero_on(Hermite const& curve, size_t which, Place a, Place b) {
  const double precision = on_curve * (b.at - a.at);
  Bracket bracket(a, b);
  double at = bracket.next(), last = INFINITY;
  for (int k = 0; k < looks && std::abs(at - last) > precision; ++k) {
    bracket.narrow({at, tests(curve.value(at), curve.derivative(at))[which].value});
    last = at, at = bracket.next();
  }
  return at;
}

/// First off the curve through the step's ends and, where the branch is smooth, the point before; then off
/// that through the first trial too, from there on off the cubic through the last two, from the fourth on as
/// long as values fall tenfold. Where it foretells no other place the zero is found, and where it foretells
/// one so near that it needs no corrector: the slope, of which test functions are made, is off by y''''/12
/// move apart^2 there, and so is the zero (0.3 to 3.4 move apart^2 in steps of the cases). Where the test
/// function jumps, Illinois' form of regula falsi goes on, and can only bisect: eight trials are enough then
/// for an extremum, and the last one, nearest to the jump, is taken; else the best.
std::optional<Continuation::Trial> Continuation::root(size_t which, Place a, Place b, Hermite const& curve,
                                                      double length, double& found) {
  TestFunction const& test = anchor_tests_[which];
  const double precision = 1e-9 * length, size = std::max(std::abs(a.value), std::abs(b.value));
  const int trials = test.extremum ? 8 : 12;
  std::vector<std::pair<double, Trial>> tried;
  const double last_length = anchor_.smooth ? row_value_ - dot(row_, before_.y) : 0;
  const bool far_enough = last_length > length / 8;  // what Newton left there counts (length / last length)^3
  Hermite known = far_enough ? with(curve, -last_length, before_.y, before_.tangent) : curve, through = known;
  Bracket bracket(a, b);
  double best_value = INFINITY, at = foretold_zero(known, which, bracket);
  size_t best = 0;
  Place before = a;
  for (int k = 0; k < trials && bracket.width() > precision; ++k) {
    Trial trial = this->at(through.value(at));
    if (!correct_inside(trial, at, length)) {
      if (k > 0 || !far_enough) break;
      trial = this->at(curve.value(at));
      if (!correct_inside(trial, at, length)) break;
    }
    const Place here{at, trial.tests[which].value};
    tried.emplace_back(at, std::move(trial));
    const bool closes_in = std::abs(here.value) < closer * best_value;
    if (std::abs(here.value) <= best_value) best_value = std::abs(here.value), best = tried.size() - 1;
    if (best_value < (test.extremum ? 1e-9 * size : 1e-12)) break;
    bracket.narrow(here);
    known = with(known, here.at, tried.back().second.y, tried.back().second.tangent);
    through = k == 0 ? known : known.between(bracket.first(), bracket.last());
    at = k == 0                    ? foretold_zero(known, which, bracket)
         : k < smooth || closes_in ? beyond(known, which, before, here, near * length)
                                   : bracket.next();
    if (!bracket.holds(at)) at = bracket.next();
    const double move = std::abs(at - here.at), apart = std::abs(here.at - before.at);
    if (move < precision) break;
    if (k > 0 && closes_in && off_zero * move * apart * apart < precision * length * length)
      if (auto there = on(through, at)) {
        found = at;
        return there;
      }
    before = here;
  }
  if (tried.empty()) return {};
  auto& [place, trial] = best_value > jump * size ? tried.back() : tried[best];
  found = place;
  return std::move(trial);
}

/// The branch's point at a place of a curve, where nothing is left for the corrector to do.
std::optional<Continuation::Trial> Continuation::on(Hermite const& curve, double at) {
  Trial trial = this->at(curve.value(at));
  newton_.system().close(row_, row_value_ + at);
  trial.outcome = newton_.as_it_stands(trial.y);
  if (!trial.outcome.converged) return {};
  trial.tangent = curve.derivative(at);
  if (!normalise(trial) || !adrift(trial).empty()) return {};
  return trial;
}

/// A curve through another point of the branch, too.
Hermite Continuation::with(Hermite const& curve, double at, Vec y, Vec tangent) const {
  const double along = dot(row_, tangent);
  return along > least_along ? curve.with({at, y, tangent, 1 / along}) : curve;
}

/// Where a curve has its zero in the bracket, else the bracket's next guess.
double Continuation::foretold_zero(Hermite const& curve, size_t which, Bracket const& bracket) {
  const auto look = [&](double at) {
    return Place{at, tests(curve.value(at), curve.derivative(at))[which].value};
  };
  const Place a = look(bracket.first()), b = look(bracket.last());
  return test_sign(a.value) * test_sign(b.value) < 0 ? zero_on(curve, which, a, b) : bracket.next();
}

/// Zero near two trials: on the cubic through them, by its secants; of their values where they are so near to
/// each other that those tell more.
double Continuation::beyond(Hermite const& known, size_t which, Place before, Place last, double apart) {
  if (std::abs(last.at - before.at) < apart) return secant(before, last);
  const Hermite curve = known.between(std::min(before.at, last.at), std::max(before.at, last.at));
  const double precision = on_curve * std::abs(last.at - before.at);
  for (int k = 0; k < looks && last.value != before.value; ++k) {
    const double at = secant(before, last);
    if (!std::isfinite(at) || std::abs(at - last.at) <= precision) return at;
    before = std::exchange(last, {at, tests(curve.value(at), curve.derivative(at))[which].value});
  }
  return last.at;
}

}  // namespace fretwave::solve
