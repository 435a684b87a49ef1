#include "hb/slider_period.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "hb/slider_derivative.h"

namespace fretwave::hb {

namespace {

constexpr double rounding = 1e-14;  // of a march, relative to the size of its motion
constexpr double parallel = 1e-7;   // sine between two discs' directions: half the digits are left
constexpr double one_disc = 1e-4;
constexpr int most_discs = 100, most_periods = 60;

double outside(double const* u, double R, double const* w) {
  return std::pow(w[0] - u[0], 2) + std::pow(w[1] - u[1], 2) - R * R;
}

}  // namespace

void SliderPeriod::clear() {
  kind = Kind::loose, unclosed = 0, touching = 0;
  path.clear();
}

void SliderPeriod::close(MovingDisc const& disc, std::vector<Span> const& spans) {
  clear();
  kind = Kind::opens;
  for (Span const& span : spans) path.land(disc, span.begin, span.begin + span.length);
}

void SliderPeriod::close(MovingDisc const& disc, std::array<double, 2> rest) {
  clear();
  const double size = disc.size();
  if (!shake_down(disc, rest.data(), size)) cycle(disc, rest.data(), size);
}

/// Add the disc that the point is farthest outside of until there is none: a linear-programming-type problem,
/// every step takes the point farther from rest.
bool SliderPeriod::shake_down(MovingDisc const& disc, double const* rest, double size) {
  held_.clear();
  w[0] = rest[0], w[1] = rest[1];
  for (int step = 0; step < most_discs; ++step) {
    const MovingDisc::Excess most = disc.farthest(w);
    const MovingDisc::Instant at = disc.at(most.tau);
    const double tolerance = rounding * (size + std::hypot(w[0], w[1])) * at.R;
    if (most.value <= tolerance) {
      kind = held_.empty() ? Kind::rests : Kind::shaken;
      // two discs that follow each other closely are one, at the time between them
      if (held_.size() == 2 && std::abs(std::remainder(held_[0].tau - held_[1].tau, period)) < one_disc)
        held_ = {{most.tau, {at.u[0], at.u[1]}, at.R}};
      if (held_.size()) follow(disc, rest);
      return true;
    }
    if (!enter({most.tau, {at.u[0], at.u[1]}, at.R}, rest, size)) return false;
  }
  return false;
}

/// Nearest point to rest on the new disc and inside those that hold; false if they have none in common.
bool SliderPeriod::enter(Held const& added, double const* rest, double size) {
  std::vector<Held> best;
  double at[2] = {}, least = std::numeric_limits<double>::infinity();
  const auto offer = [&](double x, double y, std::vector<Held> holding) {
    const double point[2] = {x, y};
    for (Held const& d : held_)
      if (outside(d.u, d.R, point) > rounding * (size + std::hypot(x, y)) * d.R) return;
    const double distance = std::hypot(x - rest[0], y - rest[1]);
    if (distance < least) least = distance, at[0] = x, at[1] = y, best = std::move(holding);
  };
  double const* u = added.u;
  const double away = std::hypot(rest[0] - u[0], rest[1] - u[1]), s = added.R / away;
  if (away > added.R) offer(u[0] + s * (rest[0] - u[0]), u[1] + s * (rest[1] - u[1]), {added});
  for (Held const& d : held_) {
    // the circles meet at `along` from u on the line of centres, `across` to either side
    const double x = d.u[0] - u[0], y = d.u[1] - u[1], apart2 = x * x + y * y, R2 = added.R * added.R;
    const double along = (1 + (R2 - d.R * d.R) / apart2) / 2, across2 = R2 / apart2 - along * along;
    if (!(across2 >= 0)) continue;
    for (const double across : {std::sqrt(across2), -std::sqrt(across2)})
      offer(u[0] + along * x - across * y, u[1] + along * y + across * x, {added, d});
  }
  if (best.empty()) return false;
  held_ = best, w[0] = at[0], w[1] = at[1];
  return true;
}

/// On one disc w = u + R (rest - u)/|rest - u|; on two e_k (dw - du_k) + dR_k = 0 with e_k from w to u_k.
/// That the times move counts for nothing: they are those of the largest excess.
void SliderPeriod::follow(MovingDisc const& disc, double const* rest) {
  constexpr int most = 4;
  touching = int(held_.size());
  double e[2][2] = {}, det = 0;
  for (int k = 0; k < touching; ++k) times[k] = held_[k].tau;
  std::fill_n(&gain_of_rates[0][0], 6, 0.0);
  if (touching == 1) return follow_one(disc, rest);
  // the times to their last digits, and w where both circles meet then
  for (int step = 0; step <= most; ++step) {
    double inside[2];
    for (int k = 0; k < 2; ++k) {
      const MovingDisc::Excess now = disc.excess(times[k], w);
      const double later = now.bend < 0 ? -now.rate / now.bend : 0;
      if (step < most && std::abs(later) < one_disc) times[k] += later;
      const MovingDisc::Instant at = disc.at(times[k]);
      const double x = at.u[0] - w[0], y = at.u[1] - w[1], length = std::hypot(x, y);
      e[k][0] = x / length, e[k][1] = y / length, inside[k] = length - at.R;
    }
    det = e[0][0] * e[1][1] - e[0][1] * e[1][0];
    if (step == most || std::abs(det) < parallel) break;
    w[0] += (e[1][1] * inside[0] - e[0][1] * inside[1]) / det;
    w[1] += (e[0][0] * inside[1] - e[1][0] * inside[0]) / det;
  }
  if (std::abs(det) < parallel) {
    // opposite directions: they have one point in common, which moves along the line of centres
    touching = 1;
    for (int row = 0; row < 2; ++row) {
      gain[0][row][0] = -e[0][row];
      for (int col = 0; col < 2; ++col) gain[0][row][col + 1] = e[0][row] * e[0][col];
    }
    return;
  }
  const double inverse[2][2] = {{e[1][1] / det, -e[0][1] / det}, {-e[1][0] / det, e[0][0] / det}};
  for (int k = 0; k < 2; ++k)
    for (int row = 0; row < 2; ++row) {
      gain[k][row][0] = -inverse[row][k];
      for (int col = 0; col < 2; ++col) gain[k][row][col + 1] = inverse[row][k] * e[k][col];
    }
}

void SliderPeriod::follow_one(MovingDisc const& disc, double const* rest) {
  constexpr int most = 8;
  for (int k = 0;; ++k) {
    const auto [x, y, r] = disc.jets(times[0]);
    const double D = std::hypot(x.d[0] - rest[0], y.d[0] - rest[1]), s = r.d[0] / D;
    const double n[2] = {(x.d[0] - rest[0]) / D, (y.d[0] - rest[1]) / D}, t[2] = {-n[1], n[0]};
    const double along = n[0] * x.d[1] + n[1] * y.d[1], across = t[0] * x.d[1] + t[1] * y.d[1];
    const double bend = n[0] * x.d[2] + n[1] * y.d[2] + across * across / D - r.d[2];
    const double step = bend < 0 ? -(along - r.d[1]) / bend : 0;
    if (k < most && std::abs(step) > 1e-14 && std::abs(step) < one_disc) {
      times[0] += step;
      continue;
    }
    for (int c = 0; c < 2; ++c) w[c] = rest[c] + (D - r.d[0]) * n[c];
    const double turn = bend < 0 ? -(1 - s) * across / bend : 0;  // of h n by h'
    for (int row = 0; row < 2; ++row) {
      gain[0][row][0] = -n[row], gain_of_rates[row][0] = -turn * t[row];
      for (int col = 0; col < 2; ++col) {
        gain[0][row][col + 1] = (row == col) - s * t[row] * t[col] + turn * t[row] * t[col] * across / D;
        gain_of_rates[row][col + 1] = turn * t[row] * n[col];
      }
    }
    return;
  }
}

/// Newton for w = P(w) with A = dP/dw. Near the onset of slip a good step leaves a large residual that one
/// period P removes, so a step is judged after it; a step that fails is halved from P of the last good point,
/// which is never worse than that.
void SliderPeriod::cycle(MovingDisc const& disc, double const* rest, double size) {
  enum { newton, smoothed, plain } last = plain;
  double after[2] = {0, 0}, least = std::numeric_limits<double>::infinity(), damping = 1;
  SliderDerivative derivative;
  std::array<double, 2> at = path.march(disc, 0, period, {rest[0], rest[1]});
  kind = Kind::cycles;
  for (int step = 0; step < most_periods; ++step) {
    path.clear();
    const std::array<double, 2> end = path.march(disc, 0, period, at);
    const double r[2] = {end[0] - at[0], end[1] - at[1]}, now = std::hypot(r[0], r[1]);
    w[0] = at[0], w[1] = at[1], unclosed = now;
    if (now <= rounding * size) return;
    if (last == plain || now < least) {
      double A[2][2], periodic[2][2];
      derivative.of_start(path, disc, A), invert(A, periodic);
      damping = last == plain ? damping : std::min(1.0, 2 * damping);
      last = newton, least = now;
      for (int row = 0; row < 2; ++row) {
        after[row] = end[row];
        at[row] += damping * (periodic[row][0] * r[0] + periodic[row][1] * r[1]);
      }
    } else {
      last = last == newton ? smoothed : plain;
      if (last == plain) damping /= 2;
      for (int row = 0; row < 2; ++row) at[row] = last == smoothed ? end[row] : after[row];
    }
  }
}

void SliderPeriod::invert(double const (&A)[2][2], double (&inverse)[2][2]) {
  const double a = 1 - A[0][0], b = -A[0][1], c = -A[1][0], d = 1 - A[1][1];
  const double det = std::max(a * d - b * c, rounding);  // A contracts: det >= 0, and 0 at the onset of slip
  inverse[0][0] = d / det, inverse[0][1] = -b / det, inverse[1][0] = -c / det, inverse[1][1] = a / det;
}

}  // namespace fretwave::hb
