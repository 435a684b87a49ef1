#include "hb/swept_slider.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fretwave::hb {

namespace {

using Slip = SweptSlider::Slip;
using Instant = MovingDisc::Instant;
constexpr int stages = Radau::stages;
constexpr double touching = 1e-13;  // of R: a slider this near to the edge is on it
constexpr double shortest = 1e-11;  // panel: what e forgets sooner counts for nothing in a force
constexpr int most_chatter = 4;
constexpr size_t most_pieces = 20000;  // what is cut finer than that is not resolved
constexpr double coarse = 1e5;         // of what is allowed: even so a derivative is good to some digits
constexpr double falling = 1e-8;       // last coefficient of a panel's series; what it neglects is smaller

/// Rate at which the slider moves, l = u'.e - R'.
double drag(Instant const& now, std::array<double, 2> const& e) {
  return now.v[0] * e[0] + now.v[1] * e[1] - now.dR;
}

}  // namespace

std::array<double, 2> Slip::turned(double p) const {
  const double c = (1 - p * p) / (1 + p * p), s = 2 * p / (1 + p * p);
  return {c * e[0] - s * e[1], c * e[1] + s * e[0]};
}

std::array<double, 2> SweptSlider::direction(MovingDisc const& disc, Slip const& slip, double tau) {
  Slip part = slip;
  part.length = tau - slip.begin;
  if (!(part.length > shortest)) return {slip.e[0], slip.e[1]};
  const bool solved = collocate(disc, part) < INFINITY;
  return solved ? part.direction(stages - 1) : slip.turned(radau().at(slip.p, part.length / slip.length));
}

/// Newton's method for the panel's p.
double SweptSlider::collocate(MovingDisc const& disc, Slip& slip) {
  constexpr int most = 12;
  Radau const& method = radau();
  const int first = disc.grid->first_node(slip.begin, slip.length);
  for (int j = 0; j < stages; ++j)
    slip.at[j] = first < 0 ? disc.at(slip.begin + method.nodes[j] * slip.length) : disc.node(first + j);
  Radau::Stages along, across;
  for (int j = 0; j < stages; ++j) {
    double const* v = slip.at[j].v;
    along[j] = slip.length * (v[0] * slip.e[0] + v[1] * slip.e[1]);
    across[j] = slip.length * (v[1] * slip.e[0] - v[0] * slip.e[1]);
  }
  slip.p.fill(0);
  double step = 1;
  for (int k = 0; k < most && step > 1e-9; ++k) {
    std::array<Radau::Stages, stages> A;
    Radau::Stages b;
    for (int j = 0; j < stages; ++j) {
      const double R = std::max(slip.at[j].R, 0.0), p = slip.p[j];
      double rate = 0;
      for (int i = 0; i < stages; ++i) rate += method.derivative[j][i] * slip.p[i];
      b[j] = across[j] * (1 - p * p) / 2 - along[j] * p - R * rate;
      for (int i = 0; i < stages; ++i) A[j][i] = R * method.derivative[j][i];
      A[j][j] += along[j] + across[j] * p;
    }
    if (!solve_stages(A, b.data())) return INFINITY;
    step = 0;
    for (int j = 0; j < stages; ++j) slip.p[j] += b[j], step = std::max(step, std::abs(b[j]));
    if (!(step < 2)) return INFINITY;
  }
  // where the slider is pushed ahead, u'.e < 0, what lies beside it grows: that must be seen, however small
  double last = 0, before = 0, growth = 0;
  for (int j = 0; j < stages; ++j) {
    if (std::abs(slip.p[j]) > 1) return INFINITY;
    const double ahead = along[j] + across[j] * slip.p[j];
    if (ahead < 0) growth = std::max(growth, -ahead / std::max(slip.at[j].R, 1e-300));
    last += method.last[j] * slip.p[j], before += method.last_but_one[j] * slip.p[j];
  }
  if (step > 1e-9) return INFINITY;
  return std::max(std::max(std::abs(last), std::abs(before) / 30) / falling, std::pow(growth, stages));
}

/// Shares of a panel between which its slider would begin to be pushed back, l < 0: at its nodes, or where
/// the parabola of three dips. False if nowhere.
bool SweptSlider::pushed_back(MovingDisc const& disc, Slip const& slip, double& low, double& high) {
  Radau::Stages const& x = radau().nodes;
  Radau::Stages l;
  for (int j = 0; j < stages; ++j) {
    l[j] = drag(slip.at[j], slip.direction(j));
    low = j ? x[j - 1] : 0;
    if (l[j] < 0) return high = x[j], true;
    if (j < 2 || !(l[j - 1] < l[j - 2] && l[j - 1] <= l[j])) continue;
    const double before = (l[j - 1] - l[j - 2]) / (x[j - 1] - x[j - 2]),
                 after = (l[j] - l[j - 1]) / (x[j] - x[j - 1]);
    const double bend = (after - before) / (x[j] - x[j - 2]);
    low = x[j - 2], high = (x[j - 2] + x[j - 1]) / 2 - before / (2 * bend);
    if (l[j - 2] + (high - low) * (before + bend * (high - x[j - 1])) > 0.2 * l[j - 2]) continue;
    if (drag(disc.at(slip.begin + high * slip.length), slip.turned(radau().at(slip.p, high))) < 0)
      return true;
  }
  return false;
}

/// Cuts a panel where its slider stops: l = 0 between these times from its begin.
void SweptSlider::stop(MovingDisc const& disc, Slip& slip, double low, double high) {
  constexpr int most = 40;
  constexpr double near = 1e-4;
  const Slip whole = slip;
  // on the panel's polynomial first
  const auto guess = [&](double s) {
    return drag(disc.at(whole.begin + s), whole.turned(radau().at(whole.p, s / whole.length)));
  };
  double below = low, above = high, ahead = guess(low), behind = guess(high), x = high;
  for (int k = 0; k < most && above - below > near * high; ++k) {
    const bool secant = ahead > 0 && behind < 0;
    const double before =
        std::exchange(x, below + (above - below) * (secant ? ahead / (ahead - behind) : 0.5));
    const double value = guess(x);
    if (std::abs(x - before) <= near * high) break;
    // Illinois: an end that stays counts for half
    if (value > 0)
      below = x, ahead = value, behind /= 2;
    else
      above = x, behind = value, ahead /= 2;
  }
  for (int k = 0; k < most; ++k) {
    slip.length = x;
    collocate(disc, slip);
    const double end = slip.begin + x;
    const std::array<double, 2> e = slip.direction(stages - 1);
    const auto [ux, uy, r] = disc.jets(end);
    const double value = ux.d[1] * e[0] + uy.d[1] * e[1] - r.d[1];
    const double side = uy.d[1] * e[0] - ux.d[1] * e[1];
    const double slope = ux.d[2] * e[0] + uy.d[2] * e[1] - r.d[2] + side * side / std::max(r.d[0], 1e-300);
    (value > 0 ? low : high) = x;
    const double next = x - value / slope;
    const bool inside = next >= low && next <= high;
    if (inside && std::abs(next - x) <= 1e-10 * std::max(x, 1e-3)) {
      slip.length = next;
      collocate(disc, slip);
      return;
    }
    x = inside ? next : (low + high) / 2;
    if (high - low <= 1e-15) return;
  }
}

void SweptSlider::stick(MovingDisc const& disc, double end, State& now) {
  const double until = disc.exit(now.tau, end, now.w, now.at_edge);
  pieces.push_back({false, int(sticks.size())});
  sticks.push_back({now.start, now.tau, until - now.tau, {now.w[0], now.w[1]}});
  now.tau = until;
  if (until >= end) return;
  const Instant here = disc.at(until);
  const double x = here.u[0] - now.w[0], y = here.u[1] - now.w[1], d = std::hypot(x, y);
  now.e[0] = x / d, now.e[1] = y / d;
  now.slips = now.onset = true, now.start = Start::follows;
}

/// One panel, at most to the next line of the grid.
void SweptSlider::slip(MovingDisc const& disc, double end, State& now, double& trial) {
  const double length = disc.grid->length();
  const double line = std::floor(now.tau / length + 1e-9) * length;
  if (std::abs(now.tau - line) < 1e-9 * length) now.tau = line;
  const double left = std::min(end, line + length) - now.tau;
  if (pieces.size() >= most_pieces) trial = length;
  const double next = trial >= left ? left : std::min(trial, left / 2);
  Slip piece{now.start, now.tau, next, {now.e[0], now.e[1]}, {}, {}, now.onset};
  double error = collocate(disc, piece);
  // where the pair opens e is forgotten: it counts by its force, R e, alone
  if (end_opens_ && error < coarse && piece.begin + piece.length >= end)
    error *= std::min(1.0, piece.length * std::abs(piece.at[0].R) / radius_);
  if (error > 1 && now.start != Start::trails && pieces.size() < most_pieces) {
    trial = next * (error < 1e9 ? std::max(0.1, 0.8 * std::pow(error, -1.0 / stages)) : 0.1);
    if (trial > shortest) return;
    const Instant here = disc.at(now.tau);
    const double speed = std::hypot(here.v[0], here.v[1]);
    if (speed > 0) now.e[0] = here.v[0] / speed, now.e[1] = here.v[1] / speed;
    now.start = Start::trails, trial = 100 * shortest;
    return;
  }
  if (!(error < 1e9)) piece.p.fill(0);  // too fine a turn to be seen
  const double factor = 0.8 * std::pow(std::max(error, 1e-9), -1.0 / stages);
  double low, high;
  const bool stops =
      now.chatter < most_chatter && pieces.size() < most_pieces && pushed_back(disc, piece, low, high);
  if (stops) stop(disc, piece, low * piece.length, high * piece.length);
  now.chatter = piece.length < shortest ? now.chatter + 1 : 0;
  pieces.push_back({true, int(slips.size())});
  slips.push_back(piece);
  const std::array<double, 2> e = piece.direction(stages - 1);
  now.tau = piece.begin + piece.length, trial = std::clamp(factor, 0.5, 8.0) * piece.length;
  now.e[0] = e[0], now.e[1] = e[1];
  now.start = Start::follows, now.onset = false;
  for (int c = 0; c < 2; ++c) now.w[c] = piece.at[stages - 1].u[c] - piece.at[stages - 1].R * e[c];
  if (stops) now.slips = false, now.at_edge = true, trial = length;
}

std::array<double, 2> SweptSlider::go(MovingDisc const& disc, double end, State now) {
  double trial = disc.grid->length();
  while (end - now.tau > 1e-15 * std::max(1.0, std::abs(end))) {
    if (now.slips)
      slip(disc, end, now, trial);
    else
      stick(disc, end, now);
  }
  return {now.w[0], now.w[1]};
}

std::array<double, 2> SweptSlider::march(MovingDisc const& disc, double begin, double end,
                                         std::array<double, 2> w) {
  end_opens_ = false;
  const Instant here = disc.at(begin);
  const double x = here.u[0] - w[0], y = here.u[1] - w[1], d = std::hypot(x, y);
  State now{
      .tau = begin, .slips = false, .start = Start::given, .w = {w[0], w[1]}, .e = {}, .at_edge = false};
  if (d >= here.R * (1 - touching) && d > 0) {
    now.e[0] = x / d, now.e[1] = y / d;
    for (int c = 0; c < 2; ++c) now.w[c] = here.u[c] - here.R * now.e[c];
    now.slips = now.onset = drag(here, {now.e[0], now.e[1]}) > 0, now.at_edge = true;
  }
  return go(disc, end, now);
}

void SweptSlider::land(MovingDisc const& disc, double begin, double end) {
  end_opens_ = true, radius_ = 0;
  for (Instant const& node : disc.at_nodes) radius_ = std::max(radius_, node.R);
  const Instant here = disc.at(begin);
  const double speed = std::hypot(here.v[0], here.v[1]);
  State now{
      .tau = begin, .slips = speed > here.dR, .start = Start::closes, .w = {here.u[0], here.u[1]}, .e = {}};
  if (now.slips) now.e[0] = here.v[0] / speed, now.e[1] = here.v[1] / speed;
  go(disc, end, now);
}

}  // namespace fretwave::hb
