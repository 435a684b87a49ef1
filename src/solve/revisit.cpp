/// Whether a branch comes back to where it has been.
#include <algorithm>
#include <cmath>

#include "solve/continuation.h"
#include "tuned.h"

namespace fretwave::solve {

namespace {

const Tuned walked("branch_walk", 8, "steps to a place where the branch seems to have been");
const Tuned certain("branch_certain", 3, "meetings with earlier points of the branch in a row");
constexpr int circles = 3;         // points in a row that repeat others, or where they are
constexpr double aside = 0.1;      // of a step: as far as it may lead from its tangent
constexpr double longer = 2;       // than those before: a plane that the branch comes along, not across
constexpr double rounding = 1e-8;  // arclength: by which any step may

}  // namespace

/// Whether the branch passes places again where it has been; it ends then. Each suspicion is confirmed by
/// Newton on the plane through such a place, and three in a row are certainty: sheets may lie side by side.
/// Pieces so short that corners lead from one to the next and back are no sheets: there points, or where they
/// are, repeat themselves.
bool Continuation::been_here(Trial const& trial) {
  const auto meeting = trail_.meeting(trial.y, trial.tangent);
  trail_.add(trial.y, trial.tangent);
  circles_ = trail_.circles() ? circles_ + 1 : 0;
  if (circles_ >= circles) {
    finish("the branch turns in circles between corners at " + problem_.parameter_text(parameter_of(trial.y)),
           false);
    return true;
  }
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

/// Whether a trial lies on an older piece of the branch, passed the other way: sheets that lie side by side
/// behind a fold are nearer to each other than a step is long.
bool Continuation::fell_back(Trial const& trial) {
  const auto meeting = trail_.meeting(trial.y, trial.tangent);
  return meeting && !meeting->forwards && passes(trial, *meeting);
}

/// Walks along the branch to where the row has a value, from plane to plane, in steps short enough not to
/// fall onto a sheet beside it. False where it is lost: none is to lead far aside of its tangent.
bool Continuation::walk(Trial& there, Vec row, double to) {
  double longest = INFINITY;
  for (int left = walked.count(); left > 0; --left) {
    const double from = dot(row, there.y), next = left > 1 ? from + (to - from) / left : to,
                 step = (next - from) / dot(row, there.tangent);
    if (!(std::abs(step) <= longest)) return false;
    longest = std::min(longest, longer * std::abs(step));
    const VecHandle expected = moved(there.y, step, there.tangent);
    there.y = copy(expected);
    if (!correct(there, row, next, row_)) return false;
    if (!(distance(there.y, expected) <= aside * std::abs(step) + rounding)) return false;
  }
  return true;
}

/// Walks from the trial to the remembered place.
bool Continuation::passes(Trial const& trial, Trail::Meeting const& meeting) {
  VecHandle row = like(trial.y);
  Trail::fill(row, meeting.functional);
  Trial there = at(copy(trial.y));
  there.tangent = copy(trial.tangent);
  return walk(there, row, meeting.place[meeting.functional]) && Trail::same(there.y, meeting.place) &&
         !on_other_sheet(trial, there);
}

}  // namespace fretwave::solve
