/// What the cubics through a branch's points foretell of the next one, and how far off they are.
#include <algorithm>
#include <cmath>

#include "solve/continuation.h"
#include "tuned.h"

namespace fretwave::solve {

namespace {

const Tuned nearer("branch_nearer", 0.5,
                   "distance of the cubic's guess over the tangent's, for it to be taken");
const Tuned other_than(
    "branch_other", 1.5,
    "slope that a fourth derivative does not tell of, in largest errors of a step over its "
    "length: a step is looked into");

}  // namespace

/// By the cubic through the last two points, on the plane at this length.
VecHandle Continuation::by_cubic(double length) {
  const double last = distance(anchor_.y, before_.y);
  VecHandle y = Hermite(before_.y, before_.tangent, anchor_.y, anchor_.tangent, last).value(last + length);
  check(VecAXPY(y, row_value_ + length - dot(row_, y), anchor_.tangent));
  return y;
}

/// The next point's guess: by the tangent, or by the cubic where that has foretold the anchor better.
VecHandle Continuation::predicted(double length) {
  return anchor_.smooth ? by_cubic(length) : moved(anchor_.y, length, anchor_.tangent);
}

/// Whether the cubic foretells a point better than the tangent does, by far.
bool Continuation::foretold(Vec y, double length) {
  if (turned_ || !before_.y) return false;
  const auto off = [&](VecHandle guess) { return distance(y, guess); };
  return off(by_cubic(length)) < nearer * off(moved(anchor_.y, length, anchor_.tangent));
}

/// What `off`, the anchor's distance from a cubic through its neighbours, does not tell of the cubic's slope
/// there: were both of y'''' alone, the slope would be off by 2 (L - H) / (H L) times as much across the
/// branch (along it chords in place of arcs count). Times H L / (H + L), a distance as well.
double Continuation::untold(Hermite const& across, Vec off, double last, double now) {
  const VecHandle slope = moved(across.derivative(last), -2 * (now - last) / (now * last), off);
  check(VecAXPY(slope, -dot(row_, slope), anchor_.tangent));
  return weighted_norm(weights_, slope) * now * last / (now + last);
}

/// Distance of the anchor from the cubic through its neighbours, y'''' (H L)^2 / 24 for steps H and L, scaled
/// to the error y'''' L^4 / 384 of the cubic over the new step. Where the last step is too short to tell, it
/// is measured in the middle, unless so small a turn leaves no room for an error that counts; likewise where
/// that derivative does not tell of the slope: the trial may lie on another sheet, with its tangent along
/// this one. (Motions without damping have such sheets at every internal resonance: steps that pass over
/// these reach the end of the branch.)
double Continuation::interpolation_error(Trial const& trial, double length) {
  const double last = before_.y ? distance(anchor_.y, before_.y) : 0, now = distance(trial.y, anchor_.y);
  if (!(last > length / 8)) {
    const double most = turn_of(trial) * length / 8;
    return most > steps_.max_error / 2 ? error_in_the_middle(trial, length) : most;
  }
  const Hermite across(before_.y, before_.tangent, trial.y, trial.tangent, last + now);
  const VecHandle off = moved(across.value(last), -1, anchor_.y);
  const double ratio = now / last, size = weighted_norm(weights_, off),
               error = size * std::min(ratio * ratio, 4.0) / 16;
  if (size <= steps_.max_error || error > steps_.max_error || !problem_.damped(trial.y)) return error;
  const bool strange = untold(across, off, last, now) > other_than * steps_.max_error;
  return strange ? std::max(error, error_in_the_middle(trial, length)) : error;
}

/// By the branch's point there, of which a few digits are enough.
double Continuation::error_in_the_middle(Trial const& end, double length) {
  const Hermite curve(anchor_.y, anchor_.tangent, end.y, end.tangent, length, 1 / dot(row_, end.tangent));
  Trial middle = at(curve.value(length / 2));
  const VecHandle expected = copy(middle.y);
  if (!find(middle, row_, dot(row_, expected), Effort::rough)) return INFINITY;
  return distance(middle.y, expected);
}

}  // namespace fretwave::solve
