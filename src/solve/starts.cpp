/// Where a branch starts: at a guess, where an interrupted one was, or where one of other equations was.
#include <algorithm>
#include <cmath>

#include "solve/continuation.h"
#include "solve/vectors.h"
#include "tuned.h"

namespace fretwave::solve {

namespace {

const Tuned at_the_end("branch_at_the_end", 1e-9,
                       "relative distance at which a branch starts at the end of its range");
const Tuned set_aside(
    "branch_aside", 0.5,
    "arclength by which another set of harmonics may move a point: farther off is another branch");
const Tuned leash("branch_leash", 1.0 / 3,
                  "share of the range by which a branch may leave it where it began");
const Tuned farthest("branch_farthest", 4, "factor by which it may leave the range there at most");

}  // namespace

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
  open_the_range();
  prepare_row();
  trail_.add(anchor_.y, anchor_.tangent);
  return point(std::move(trial), "start", 0);
}

std::optional<Point> Continuation::restore(Anchor anchor, Anchor before, int emitted, bool upwards,
                                           double began) {
  anchor_ = std::move(anchor), before_ = std::move(before);
  upwards_ = upwards, began_ = began;
  open_the_range();
  prepare_row();
  trail_.add(anchor_.y, anchor_.tangent);
  if (emitted == 0) return {};
  make_batch();
  emitted_ = std::min(emitted, int(batch_.size()));
  if (emitted_ < emitted) miss("a point handed out before the interruption", "it is not met again");
  if (emitted_ == 0) return {};
  return std::move(batch_[emitted_ - 1].second);
}

std::optional<Point> Continuation::take_over(Anchor from, std::string const& event, bool upwards,
                                             double began) {
  anchor_ = std::move(from);
  anchor_.sign = 0;  // that of other equations
  upwards_ = upwards, began_ = began, taken_over_ = true;
  open_the_range();
  prepare_row();
  // at the same parameter, so that no report is passed twice or not at all; beside a fold there may be none
  const bool given = event == "start" || event == "report" || event == "stop";
  const auto near = [&](Trial const& trial) { return distance(trial.y, anchor_.y) <= set_aside; };
  Trial trial = at(copy(anchor_.y));
  bool there = correct(trial, parameter_row_, last_entry(trial.y), row_) && near(trial);
  if (!given && !(there && turn_of(trial) <= steps_.max_angle)) {
    trial = at(copy(anchor_.y));
    there = correct(trial, row_, row_value_, row_) && near(trial);
  }
  if (!there) return {};
  anchor_.y = copy(trial.y), anchor_.tangent = copy(trial.tangent);
  prepare_row();
  signs_.clear();
  for (auto const& test : anchor_tests_)  // what was met is not met again
    signs_.push_back(event.find(test.name) == std::string::npos ? test_sign(test.value) : 0);
  trail_.add(anchor_.y, anchor_.tangent);
  return point(std::move(trial), event, 0);
}

/// A branch may fold back over the end it began at and come in again: it is followed some way outside.
void Continuation::open_the_range() {
  const double low = problem_.parameter_entry(given_low_), high = problem_.parameter_entry(given_high_),
               room = leash * (high - low);
  const auto at_end = [&](double end) { return std::abs(began_ - end) <= at_the_end * std::abs(end); };
  low_ = given_low_, high_ = given_high_;
  if (upwards_ && at_end(low_))
    low_ = std::max(problem_.parameter_value(low - room), low_ > 0 ? low_ / farthest : -INFINITY);
  if (!upwards_ && at_end(high_))
    high_ = std::min(problem_.parameter_value(high + room), high_ > 0 ? farthest * high_ : INFINITY);
}

}  // namespace fretwave::solve
