#include "solve/continuation.h"

#include <algorithm>
#include <cmath>

namespace fretwave::solve {

namespace {

// A turn that is left in so short a step is a kink (a sample changes state), not curvature.
constexpr double kink_length = 1e-4;
constexpr double kink_angle = 0.02;  // [rad] in so short a step
constexpr double seen_angle = 0.05;  // [rad] in a longer one: it may hide a corner
constexpr int certain = 3;           // meetings with earlier points of the branch in a row
constexpr double at_the_end = 1e-9;  // relative: a branch that starts here starts at the end of its range

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
  parameter_row_ = zero_like(row_);
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
  p.parameter = parameter_of(trial.y);
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

/// Newton on the system closed by row . y = value, then the unit tangent there, oriented along `tangent_row`.
bool Continuation::correct(Trial& trial, Vec row, double value, Vec tangent_row) {
  newton_.system().close(row, value);
  trial.outcome = newton_.solve(trial.y);
  if (!trial.outcome.converged) return false;
  if (const std::string why = problem_.impossible(trial.y); !why.empty()) {
    trial.outcome.reason = why;
    return false;
  }
  trial.tangent = anchor_.tangent ? copy(anchor_.tangent) : zero_like(trial.y);
  if (tangent_row != row) newton_.system().close(tangent_row, 0);
  if (!newton_.tangent(trial.y, trial.tangent)) {
    trial.outcome.reason = "the linear solve for the tangent fails";
    return false;
  }
  VecHandle weights = like(trial.y);
  problem_.metric(trial.y, weights);
  const double size = weighted_norm(weights, trial.tangent);
  if (!std::isfinite(size)) {
    trial.outcome.reason = "the tangent is not finite";
    return false;
  }
  check(VecScale(trial.tangent, 1 / size));
  trial.tests = tests(trial.y, trial.tangent);
  return true;
}

std::optional<Point> Continuation::start(Vec y0, bool upwards) {
  Trial trial = at(copy(y0));
  finished_ = false;  // an earlier start may have failed
  check(VecCopy(parameter_row_, row_));
  row_value_ = last_entry(y0);
  upwards_ = upwards;
  if (!correct(trial, row_, row_value_, row_)) {
    finish("no solution at the start: " + trial.outcome.reason, false);
    return {};
  }
  if ((last_entry(trial.tangent) > 0) != upwards) check(VecScale(trial.tangent, -1));
  anchor_ = {.y = copy(trial.y), .tangent = copy(trial.tangent), .step = steps_.initial, .index = 1};
  began_ = parameter_of(trial.y);
  prepare_row();
  (void)trail_.add(anchor_.y, anchor_.tangent);
  return point(std::move(trial), "start", 0);
}

std::optional<Point> Continuation::restore(Anchor anchor, Anchor before, int emitted, bool upwards,
                                           double began) {
  anchor_ = std::move(anchor), before_ = std::move(before);
  upwards_ = upwards, began_ = began;
  prepare_row();
  (void)trail_.add(anchor_.y, anchor_.tangent);
  if (emitted == 0) return {};
  make_batch();
  emitted_ = std::min(emitted, int(batch_.size()));
  if (emitted_ < emitted) miss("a point handed out before the interruption", "it is not met again");
  if (emitted_ == 0) return {};
  return std::move(batch_[emitted_ - 1].second);
}

/// Closing row W t at the anchor: row . (y - y_anchor) is the arclength.
void Continuation::prepare_row() {
  problem_.metric(anchor_.y, weights_);
  check(VecPointwiseMult(row_, weights_, anchor_.tangent));
  row_value_ = dot(row_, anchor_.y);
  anchor_tests_ = tests(anchor_.y, anchor_.tangent);
}

/// Angle between the anchor's tangent and the trial's [rad].
double Continuation::turn_of(Trial const& trial) const {
  return std::acos(std::clamp(dot(row_, trial.tangent), -1.0, 1.0));
}

/// Distance of the anchor from the cubic through its neighbours, y'''' (H L)^2 / 24 for steps H and L, scaled
/// to the error y'''' L^4 / 384 of the cubic over the new step.
double Continuation::interpolation_error(Trial const& trial, double length) const {
  if (!before_.y) return 0;
  const double last = weighted_norm(weights_, moved(anchor_.y, -1, before_.y)),
               now = weighted_norm(weights_, moved(trial.y, -1, anchor_.y));
  if (!(last > length / 8)) return 0;  // too short a step to tell
  const Hermite across(before_.y, before_.tangent, trial.y, trial.tangent, last + now);
  const double ratio = now / last;
  return weighted_norm(weights_, moved(across.value(last), -1, anchor_.y)) * std::min(ratio * ratio, 4.0) /
         16;
}

/// What speaks against a corrected trial as the next point; nothing if it is one.
std::string Continuation::complaint(Trial& trial, double length, bool may_shorten) {
  const VecHandle predicted = moved(anchor_.y, length, anchor_.tangent);
  if (!(weighted_norm(weights_, moved(trial.y, -1, predicted)) <= length))
    return "the corrector lands on another branch";
  const double angle = turn_of(trial);
  if (may_shorten && angle > steps_.max_angle) return "the branch turns too sharply";
  if (may_shorten && interpolation_error(trial, length) > steps_.max_error)
    return "the branch bends more than a step resolves";
  if (may_shorten)
    return angle > seen_angle && leads_back(trial) ? "the corrector lands on another branch" : "";
  if (angle < kink_angle) return "";
  const int sign = orientation(trial.y, trial.tangent);
  if (sign == 0) return angle > steps_.max_angle ? "the branch turns too sharply" : "";
  if (sign < 0) {
    check(VecScale(trial.tangent, -1));
    trial.tests = tests(trial.y, trial.tangent);
  }
  turned_ = angle > steps_.max_angle;
  return "";
}

/// One accepted step from the anchor; halves the length on failure or when the branch bends too much, and
/// turns a corner that no shorter step gets round.
std::optional<Continuation::Trial> Continuation::step(double& length, double& next_length) {
  std::string why;
  const bool after_corner = anchor_.turned;
  turned_ = false;
  for (length = anchor_.step; length >= steps_.minimum; length /= 2) {
    const bool may_shorten = length > std::max(kink_length, 16 * steps_.minimum);
    Trial trial = at(moved(anchor_.y, length, anchor_.tangent));
    why = correct(trial, row_, row_value_ + length, row_) ? complaint(trial, length, may_shorten)
                                                          : trial.outcome.reason;
    if (!why.empty() && !may_shorten) {
      if (auto behind = turn_corner(length)) {
        trial = std::move(*behind);
        turned_ = true;
        why.clear();
      }
    }
    if (!why.empty()) continue;
    const double by_angle = turned_ ? 1.0 : 0.5 * steps_.max_angle / std::max(turn_of(trial), 1e-12),
                 by_error = std::pow(
                     0.5 * steps_.max_error / std::max(interpolation_error(trial, length), 1e-16), 0.25);
    const bool shortened = length < anchor_.step;
    const double most = shortened ? 1.0 : after_corner || length < kink_length ? 4.0 : 2.0;
    next_length = std::min(steps_.maximum, length * std::clamp(std::min(by_angle, by_error), 0.3, most));
    return trial;
  }
  finish("step too small: " + why, false);
  return {};
}

/// Whether the branch passes places again where it has been; it ends then. Each suspicion is confirmed by
/// Newton on the plane through such a place, and three in a row are certainty: sheets may lie side by side.
bool Continuation::been_here(Trial const& trial) {
  const auto meeting = trail_.add(trial.y, trial.tangent);
  if (!meeting || !passes(trial, *meeting)) {
    meetings_ = 0;
    return false;
  }
  if (++meetings_ < certain) return false;
  const std::string where = problem_.parameter_text(parameter_of(trial.y));
  finish(meeting->forwards ? "the branch is a closed loop: it comes back to " + where + ", where it has been"
                           : "the branch turns back onto itself: it passes " + where + " a second time",
         false);
  return true;
}

bool Continuation::passes(Trial const& trial, Trail::Meeting const& meeting) {
  Trial there = at(moved(trial.y, meeting.along, trial.tangent));
  const VecHandle expected = copy(there.y);
  VecHandle row = like(trial.y);
  Trail::fill(row, meeting.functional);
  if (!correct(there, row, meeting.place[meeting.functional], row_)) return false;
  const double off = weighted_norm(weights_, moved(there.y, -1, expected));
  return off <= 0.1 * std::abs(meeting.along) + 1e-8 && Trail::same(there.y, meeting.place);
}

/// The branch has left its range at this end.
void Continuation::arrive(double reached) {
  const double goal = upwards_ ? high_ : low_;
  arrived_ = reached == goal;
  const std::string end = problem_.parameter_text(reached);
  if (arrived_)
    ending_ = "stop value reached";
  else if (std::abs(began_ - reached) <= at_the_end * std::abs(reached))
    ending_ = "the branch comes back to " + end + ", where it began, without reaching " +
              problem_.parameter_text(goal);
  else
    ending_ = "the branch turns round and leaves its range at " + end + " instead of " +
              problem_.parameter_text(goal);
}

/// All points of the next step in order: events inside it, then its end (or the stop value).
void Continuation::make_batch() {
  batch_.clear();
  emitted_ = 0;
  double length, next_length;
  auto end = step(length, next_length);
  if (!end || been_here(*end)) return;
  std::string events;
  if (turned_)
    events = events_of_corner(*end);
  else
    locate_events(*end, length);
  ending_ = problem_.beyond(end->y);
  after_ = {
      .y = copy(end->y), .tangent = copy(end->tangent), .step = next_length, .index = 0, .turned = turned_};
  const double reached = last_entry(end->y);
  const bool outside =
      reached <= problem_.parameter_entry(low_) || reached >= problem_.parameter_entry(high_);
  if (!outside) emit(std::move(*end), length, std::move(events));
  std::stable_sort(batch_.begin(), batch_.end(),
                   [](auto const& x, auto const& y) { return x.first < y.first; });
  const auto stop =
      std::find_if(batch_.begin(), batch_.end(), [](auto const& x) { return x.second.event == "stop"; });
  if (stop != batch_.end()) {
    const double value = stop->second.parameter;
    batch_.erase(stop + 1, batch_.end());
    arrive(std::abs(value - low_) < std::abs(value - high_) ? low_ : high_);
  } else if (outside) {
    if (length / 2 >= steps_.minimum) {
      anchor_.step = length / 2;  // a long step's interpolation is too far from the branch
      return make_batch();
    }
    finish("the stop value is not reached: the corrector fails there", false);
  }
  after_.index = anchor_.index + int(batch_.size());
}

std::optional<Point> Continuation::next() {
  if (finished_) return {};
  if (emitted_ == int(batch_.size())) {
    if (!ending_.empty()) {
      finish(ending_, arrived_);
      return {};
    }
    if (!batch_.empty()) {
      before_ = std::move(anchor_);
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
