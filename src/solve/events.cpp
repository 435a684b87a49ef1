#include <algorithm>
#include <cmath>

#include "solve/continuation.h"

/// Points inside a step: zeros of test functions, reported values, the stop value. They are looked for on the
/// cubic through the step's ends, several of a kind if it has several, and corrected by Newton.
namespace fretwave::solve {

namespace {

constexpr int nodes = 8;           // parts of a step in which its cubic is looked at
constexpr double near_zero = 0.3;  // of the smaller end value: so low a minimum may hide two zeros

}  // namespace

void Continuation::emit(Trial&& trial, double at, std::string event) {
  batch_.emplace_back(at, point(std::move(trial), std::move(event), at));
}

void Continuation::miss(std::string const& what, std::string const& why) {
  missed_.push_back(what + ": " + why);
}

/// A guess off the step's cubic is corrected at its arclength, to a point of the same branch. Its tangent is
/// what test functions are made of.
bool Continuation::correct_inside(Trial& trial, double at, double length) {
  const VecHandle expected = copy(trial.y);
  return correct(trial, row_, row_value_ + at, row_, Effort::full, true) &&
         distance(trial.y, expected) <= off_the_curve * length;
}

void Continuation::locate_events(Trial const& end, double length) {
  const double along = dot(row_, end.tangent);
  const Hermite curve(anchor_.y, anchor_.tangent, end.y, end.tangent, length,
                      along > least_along ? 1 / along : 1);  // dy/ds = t / (row . t), row . (y - anchor) = s
  folds_.clear();
  std::vector<std::vector<Place>> scans(end.tests.size());
  for (int node = 0; node <= nodes; ++node) {
    const double at = length * node / nodes;
    const auto values = node == 0       ? anchor_tests_
                        : node == nodes ? end.tests
                                        : tests(curve.value(at), curve.derivative(at));
    for (size_t k = 0; k < scans.size(); ++k) scans[k].push_back({at, values[k].value});
  }
  if (signs_.size() != scans.size()) {
    signs_.clear();
    for (auto const& test : anchor_tests_) signs_.push_back(test_sign(test.value));
  }
  for (size_t k = 0; k < scans.size(); ++k) locate(k, scans[k], curve, length);
  locate_values(end, curve, length);
}

/// A corner lies within a step too short to tell it from its end: what changes sign or is passed there is met
/// at the end itself. (Planes across the old tangent do not order the points behind a corner.)
std::string Continuation::events_of_corner(Trial const& end) {
  std::string found;
  for (size_t k = 0; k < end.tests.size(); ++k) {
    const int before = k < signs_.size() ? signs_[k] : test_sign(anchor_tests_[k].value),
              now = test_sign(end.tests[k].value);
    if (now && k < signs_.size()) signs_[k] = now;
    if (before * now < 0 && !(end.tests[k].falling_only && before < 0))
      found += (found.empty() ? "" : " ") + end.tests[k].name;
  }
  const double from = last_entry(anchor_.y), to = last_entry(end.y);
  const auto pass = [&](double value, std::string const& event) {
    const double target = problem_.parameter_entry(value);
    if ((from < target) == (to < target) || (event != "report" && from == target)) return;
    Trial trial = at(copy(std::abs(to - target) < std::abs(from - target) ? Vec(end.y) : Vec(anchor_.y)));
    set_last_entry(trial.y, target);
    const VecHandle guess = copy(trial.y);
    const double most = 4 * distance(end.y, anchor_.y);  // it may turn back
    if (!correct(trial, parameter_row_, target, row_))
      miss(event + " at " + problem_.parameter_text(value), trial.outcome.reason);
    else if (distance(trial.y, guess) > most)
      miss(event + " at " + problem_.parameter_text(value), elsewhere);
    else
      emit(std::move(trial), 0, event);
  };
  for (double value : report_at_)
    if (value != low_ && value != high_) pass(value, "report");
  pass(low_, stop_event(low_)), pass(high_, stop_event(high_));
  return found;
}

/// All zeros of one test function in the step.
void Continuation::locate(size_t which, std::vector<Place> const& scan, Hermite const& curve, double length) {
  TestFunction const& test = anchor_tests_[which];
  const auto locate_between = [&](Place a, Place b, int before) {
    if (test.falling_only && before < 0) return;
    double found;
    if (auto trial = root(which, a, b, curve, length, found)) {
      if (test.name == "fold") folds_.push_back(found);
      emit(std::move(*trial), found, test.name);
    } else {
      miss(test.name, "the corrector fails at it or leaves for another branch, near " +
                          problem_.parameter_text(parameter_of(curve.value(secant(a, b)))));
    }
  };
  const auto actual = [&](double at) {
    Trial trial = this->at(curve.value(at));
    return correct_inside(trial, at, length) ? trial.tests[which].value : std::nan("");
  };
  // places that Newton has been to, in order; the ends of the step to begin with
  std::vector<Place> places = {scan.front(), scan.back()};
  const auto visit = [&](double at) {
    const double value = actual(at);
    if (std::isfinite(value)) places.insert(places.end() - 1, {at, value});
  };
  const bool ends_differ = test_sign(scan.front().value) * test_sign(scan.back().value) < 0;
  std::vector<double> changes;  // of sign on the cubic
  for (size_t i = 0; i + 1 < scan.size(); ++i)
    if (test_sign(scan[i].value) * test_sign(scan[i + 1].value) < 0)
      changes.push_back(secant(scan[i], scan[i + 1]));
  if (changes.size() > 1)
    for (size_t i = 0; i + 1 < changes.size(); ++i) visit((changes[i] + changes[i + 1]) / 2);
  if (changes.empty() && !ends_differ) {
    const auto lowest = std::min_element(scan.begin(), scan.end(), [](Place const& a, Place const& b) {
      return std::abs(a.value) < std::abs(b.value);
    });
    const double ends = std::min(std::abs(scan.front().value), std::abs(scan.back().value));
    if (test_sign(ends) > 0 && std::abs(lowest->value) < near_zero * ends && lowest->at > 0 &&
        lowest->at < length)
      visit(lowest->at);
  }
  int before = signs_[which];
  for (size_t i = 0; i + 1 < places.size(); ++i) {
    const int now = test_sign(places[i + 1].value);
    if (now == 0) continue;
    if (before * now < 0) locate_between(places[i], places[i + 1], before);
    before = now;
  }
  signs_[which] = before;
}

/// Reported values and the ends of the range. Between the folds of the step the parameter is monotone.
void Continuation::locate_values(Trial const& end, Hermite const& curve, double length) {
  std::sort(folds_.begin(), folds_.end());
  std::vector<Place> places = {{0, last_entry(anchor_.y)}};
  for (double at : folds_)
    for (auto const& [where, point] : batch_)
      if (where == at && point.event == "fold") places.push_back({at, last_entry(point.y)});
  places.push_back({length, last_entry(end.y)});
  const bool begins = taken_over_ || anchor_.index == 1;
  const auto each = [&](double value, std::string const& event, bool outside) {
    const double target = problem_.parameter_entry(value);
    for (size_t i = 0; i + 1 < places.size(); ++i) {
      const double from = places[i].value, to = places[i + 1].value;
      if (outside && i + 2 == places.size() && to == target && from != to) {
        emit_end(end, target, length, event);
        continue;
      }
      if ((from < target) == (to < target) || from == to) continue;
      if (outside && i == 0 && from == target) continue;  // the branch starts here
      if (begins && i == 0 && std::abs(from - target) <= value_error * std::max(1.0, std::abs(target)))
        continue;  // met already
      reach(value, event, places[i], places[i + 1], curve, length);
    }
  };
  for (double value : report_at_)
    if (value != low_ && value != high_) each(value, "report", false);
  if (places.back().value <= problem_.parameter_entry(low_) || folds_.size())
    each(low_, stop_event(low_), true);
  if (places.back().value >= problem_.parameter_entry(high_) || folds_.size())
    each(high_, stop_event(high_), true);
}

/// An end of the range that is reported as well is one point, a report.
std::string Continuation::stop_event(double end) const {
  return std::ranges::find(report_at_, end) == report_at_.end() ? "stop" : reported_stop;
}

/// The step's end, which lies at an asked parameter.
void Continuation::emit_end(Trial const& end, double target, double length, std::string const& event) {
  Trial trial = at(copy(end.y));
  trial.tangent = copy(end.tangent), trial.outcome = end.outcome;
  polish(trial, target);
  emit(std::move(trial), length, event);
}

/// A trial where the branch leaves its range, if the guess at `length` lies beyond: what is there is not
/// asked for, and may be harder. None where there is no solution, as beside a fold, or no way to speak of.
std::optional<Continuation::Trial> Continuation::attempt_end(Vec guess, double shortest, double& length) {
  const double low = problem_.parameter_entry(low_), high = problem_.parameter_entry(high_),
               beyond = last_entry(guess), goal = beyond > high ? high : low, from = last_entry(anchor_.y);
  if (!(beyond > high || beyond < low) || from == goal) return {};
  const auto predict = [&](double at) { return predicted(at); };
  const double inside = passing(predict, goal, {0, from}, length);
  if (!(inside > shortest)) return {};
  Trial trial = at(predicted(inside));
  set_last_entry(trial.y, goal);
  if (!correct(trial, parameter_row_, goal, row_, Effort::plain)) return {};
  set_last_entry(trial.y, goal);  // to the last digit, by which it is known as the end
  const double reached = dot(row_, trial.y) - row_value_;
  if (!(reached > shortest && reached <= length)) return {};
  length = reached;
  return trial;
}

}  // namespace fretwave::solve
