#include "solve/continuation.h"

#include <algorithm>
#include <cmath>

namespace fretwave::solve {

namespace {

constexpr double kink_length =
    1e-4;  // a turn that is left in so short a step is a kink (a sample changes state), not curvature
constexpr double test_noise = 1e-11;  // a test function closer to zero than this has no sign

VecHandle copy(Vec v) {
  VecHandle w = like(v);
  check(VecCopy(v, w));
  return w;
}

VecHandle zero_like(Vec v) {
  VecHandle w = like(v);
  check(VecSet(w, 0));
  return w;
}

double weighted_norm(Vec weights, Vec t) {
  VecHandle wt = like(t);
  double square;
  check(VecPointwiseMult(wt, weights, t));
  check(VecDot(wt, t, &square));
  return std::sqrt(square);
}

bool crosses(TestFunction const& before, TestFunction const& after) {
  const bool falls = before.value > test_noise && after.value < -test_noise;
  const bool rises = before.value < -test_noise && after.value > test_noise;
  return falls || (rises && !before.falling_only);
}

}  // namespace

Continuation::Continuation(Problem& problem, std::string const& prefix, double low, double high,
                           StepControl steps, std::vector<double> report_at)
    : problem_(problem),
      newton_(problem, prefix),
      low_(low),
      high_(high),
      steps_(steps),
      report_at_(std::move(report_at)) {
  row_ = problem.unknowns();
  weights_ = like(row_);
  parameter_row_ = like(row_);
  check(VecSet(parameter_row_, 0));
  set_last_entry(parameter_row_, 1);
  clock_ = MPI_Wtime();
}

void Continuation::finish(std::string reason, bool converged) {
  reason_ = std::move(reason);
  converged_ = converged;
  finished_ = true;
}

Point Continuation::point(Trial&& trial, std::string event, double step) {
  Point p;
  p.parameter = problem_.parameter_value(last_entry(trial.y));
  p.y = std::move(trial.y), p.tangent = std::move(trial.tangent);
  p.outcome = std::move(trial.outcome);
  p.event = std::move(event), p.step = step;
  p.wall = MPI_Wtime() - clock_;
  clock_ = MPI_Wtime();
  return p;
}

/// Events of the problem, and the fold: the tangent's parameter entry changes sign.
std::vector<TestFunction> Continuation::tests(Vec y, Vec tangent) {
  auto all = problem_.tests(y, tangent);
  all.push_back({"fold", last_entry(tangent), false, true});
  return all;
}

/// Newton on the system closed by row . y = value, then the unit tangent there, oriented along the row.
bool Continuation::correct(Trial& trial, Vec row, double value) {
  newton_.system().close(row, value);
  trial.outcome = newton_.solve(trial.y);
  if (!trial.outcome.converged) return false;
  trial.tangent = anchor_.tangent ? copy(anchor_.tangent) : zero_like(trial.y);
  if (row != Vec(row_)) newton_.system().close(row_, row_value_);
  if (!newton_.tangent(trial.y, trial.tangent)) {
    trial.outcome.reason = "the linear solve for the tangent fails";
    return false;
  }
  VecHandle weights = like(trial.y);
  problem_.metric(trial.y, weights);
  check(VecScale(trial.tangent, 1 / weighted_norm(weights, trial.tangent)));
  trial.tests = tests(trial.y, trial.tangent);
  return true;
}

std::optional<Point> Continuation::start(Vec y0, bool upwards) {
  Trial trial{.y = copy(y0), .tangent = {}, .outcome = {}, .tests = {}};
  check(VecCopy(parameter_row_, row_));
  row_value_ = last_entry(y0);
  if (!correct(trial, row_, row_value_)) {
    finish("no solution at the start: " + trial.outcome.reason, false);
    return {};
  }
  if ((last_entry(trial.tangent) > 0) != upwards) check(VecScale(trial.tangent, -1));
  anchor_ = {.y = copy(trial.y), .tangent = copy(trial.tangent), .step = steps_.initial, .index = 1};
  prepare_row();
  return point(std::move(trial), "start", 0);
}

void Continuation::restore(Vec y, Vec tangent, double step, int index, int emitted) {
  anchor_ = {.y = copy(y), .tangent = copy(tangent), .step = step, .index = index};
  prepare_row();
  make_batch();
  emitted_ = emitted;
}

/// Closing row W t at the anchor: row . (y - y_anchor) is the arclength.
void Continuation::prepare_row() {
  problem_.metric(anchor_.y, weights_);
  check(VecPointwiseMult(row_, weights_, anchor_.tangent));
  check(VecDot(row_, anchor_.y, &row_value_));
  anchor_tests_ = tests(anchor_.y, anchor_.tangent);
}

/// How far the corrector moved from the tangent's prediction.
double Continuation::deviation(Vec y, double length) const {
  VecHandle moved = like(y);
  check(VecWAXPY(moved, -1, anchor_.y, y));
  check(VecAXPY(moved, -length, anchor_.tangent));
  return weighted_norm(weights_, moved);
}

/// A kink may turn the branch by more than a right angle. The tangent behind it that agrees with the one
/// before then leads back, where the tangent is the old one; only along the right sign does it stay.
void Continuation::orient_past_kink(Trial& trial) {
  VecHandle weights = like(trial.y), row = like(trial.y);
  problem_.metric(trial.y, weights);
  check(VecPointwiseMult(row, weights, trial.tangent));
  double here;
  check(VecDot(row, trial.y, &here));
  const auto stays = [&](double length) {
    Trial probe{.y = copy(trial.y), .tangent = {}, .outcome = {}, .tests = {}};
    check(VecAXPY(probe.y, length, trial.tangent));
    double along;
    if (!correct(probe, row, here + length)) return false;
    check(VecDot(row, probe.tangent, &along));
    return std::abs(along) > std::cos(steps_.max_angle);
  };
  if (stays(kink_length) || !stays(-kink_length)) return;
  check(VecScale(trial.tangent, -1));
  trial.tests = tests(trial.y, trial.tangent);
}

/// One accepted step from the anchor; halves the length on failure or when the branch turns too much.
std::optional<Continuation::Trial> Continuation::step(double& length, double& angle, double& next_length) {
  std::string why = "the branch turns too sharply";
  for (length = anchor_.step; length >= steps_.minimum; length /= 2) {
    Trial trial{.y = copy(anchor_.y), .tangent = {}, .outcome = {}, .tests = {}};
    check(VecAXPY(trial.y, length, anchor_.tangent));
    if (!correct(trial, row_, row_value_ + length)) {
      why = trial.outcome.reason;
      continue;
    }
    double along;
    check(VecDot(row_, trial.tangent, &along));
    angle = std::acos(std::clamp(along, -1.0, 1.0));
    const bool may_shorten = length > std::max(kink_length, 16 * steps_.minimum);
    if (angle > steps_.max_angle && may_shorten) continue;
    if (may_shorten && deviation(trial.y, length) > length) {
      why = "the corrector lands on another branch";
      continue;
    }
    const double by_newton = std::exp2((steps_.target_newton - trial.outcome.effort) / 2.0);
    const double by_angle = 0.5 * steps_.max_angle / std::max(angle, 1e-12);
    next_length = std::min(steps_.maximum, length * std::clamp(std::min(by_newton, by_angle), 0.4, 2.0));
    if (angle > steps_.max_angle) {
      orient_past_kink(trial);
      next_length = std::min(steps_.maximum, kink_length);  // behind it the branch is smooth again
    }
    return trial;
  }
  finish("step too small: " + why, false);
  return {};
}

/// Cubic Hermite interpolation between the anchor and the end of the step.
void Continuation::interpolate(Trial const& end, double length, double at, Vec y) const {
  const double x = at / length;
  const double h00 = (1 + 2 * x) * (1 - x) * (1 - x), h10 = x * (1 - x) * (1 - x), h01 = x * x * (3 - 2 * x),
               h11 = x * x * (x - 1);
  Vec parts[4] = {anchor_.y, anchor_.tangent, end.y, end.tangent};
  const double factors[4] = {h00, h10 * length, h01, h11 * length};
  check(VecSet(y, 0));
  check(VecMAXPY(y, 4, factors, parts));
}

void Continuation::emit(Trial&& trial, double at, std::string event) {
  batch_.emplace_back(at, point(std::move(trial), std::move(event), at));
}

/// The branch at a given parameter inside the step.
void Continuation::reach(double value, std::string const& event, Trial const& end, double length) {
  const double target = problem_.parameter_entry(value), from = last_entry(anchor_.y), to = last_entry(end.y);
  const double at = length * (target - from) / (to - from);
  Trial trial{.y = like(end.y), .tangent = {}, .outcome = {}, .tests = {}};
  interpolate(end, length, at, trial.y);
  if (correct(trial, parameter_row_, target)) emit(std::move(trial), at, event);
}

/// Root of a test function on the step by the Illinois form of regula falsi in arclength. Where flags of
/// sampled contact make the function jump it can only bisect: eight trials are enough then for an extremum.
void Continuation::locate(TestFunction const& before, size_t which, Trial const& end, double length) {
  double a = 0, b = length, fa = before.value, fb = end.tests[which].value;
  const double precision = (before.extremum ? 1e-6 : 1e-9) * length;
  const int trials = before.extremum ? 8 : 12;
  std::optional<std::pair<double, Trial>> best;
  int side = 0;
  for (int iteration = 0; iteration < trials && std::abs(b - a) > precision; ++iteration) {
    const double at = (a * fb - b * fa) / (fb - fa);
    Trial trial{.y = like(end.y), .tangent = {}, .outcome = {}, .tests = {}};
    interpolate(end, length, at, trial.y);
    if (!correct(trial, row_, row_value_ + at)) break;
    const double f = trial.tests[which].value;
    const bool done = std::abs(f) < 1e-12 || (best && std::abs(at - best->first) < precision);
    best = {at, std::move(trial)};
    if (done) break;
    const int now = (f > 0) == (fb > 0) ? +1 : -1;
    double& kept = now > 0 ? fa : fb;  // the end kept twice in a row is given half its value
    if (now == side) kept /= 2;
    (now > 0 ? b : a) = at, (now > 0 ? fb : fa) = f;
    side = now;
  }
  if (best) emit(std::move(best->second), best->first, before.name);
}

void Continuation::locate_events(Trial const& end, double length) {
  for (size_t k = 0; k < anchor_tests_.size(); ++k)
    if (crosses(anchor_tests_[k], end.tests[k])) locate(anchor_tests_[k], k, end, length);
  const double from = problem_.parameter_value(last_entry(anchor_.y)),
               to = problem_.parameter_value(last_entry(end.y));
  for (double value : report_at_)
    if ((from < value) != (to < value) && from != value) reach(value, "report", end, length);
}

/// All points of the next step in order: events inside it, then its end (or the stop value).
void Continuation::make_batch() {
  batch_.clear();
  emitted_ = 0;
  double length, angle, next_length;
  auto end = step(length, angle, next_length);
  if (!end) return;
  locate_events(*end, length);
  const double reached = problem_.parameter_value(last_entry(end->y));
  stop_after_batch_ = reached <= low_ || reached >= high_;
  after_ = {.y = copy(end->y), .tangent = copy(end->tangent), .step = next_length, .index = 0};
  if (stop_after_batch_)
    reach(reached <= low_ ? low_ : high_, "stop", *end, length);
  else
    emit(std::move(*end), length, "");
  std::stable_sort(batch_.begin(), batch_.end(),
                   [](auto const& x, auto const& y) { return x.first < y.first; });
  const auto stop =
      std::find_if(batch_.begin(), batch_.end(), [](auto const& x) { return x.second.event == "stop"; });
  if (stop != batch_.end()) batch_.erase(stop + 1, batch_.end());
  if (stop_after_batch_ && stop == batch_.end() && length / 2 >= steps_.minimum) {
    anchor_.step = length / 2;  // a long step's interpolation is too far from the branch
    return make_batch();
  }
  if (stop_after_batch_ && stop == batch_.end())
    finish("the stop value is not reached: the corrector fails there", false);
  after_.index = anchor_.index + int(batch_.size());
}

std::optional<Point> Continuation::next() {
  if (finished_) return {};
  if (emitted_ == int(batch_.size())) {
    if (stop_after_batch_) {
      finish("stop value reached", true);
      return {};
    }
    if (!batch_.empty()) {
      anchor_ = std::move(after_);
      prepare_row();
    }
    if (anchor_.index >= steps_.max_points) {
      finish("largest number of points", false);
      return {};
    }
    make_batch();
    if (batch_.empty()) return {};
  }
  Point out = std::move(batch_[emitted_].second);
  out.index = anchor_.index + emitted_++;
  return out;
}

}  // namespace fretwave::solve
