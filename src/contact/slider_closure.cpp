#include "contact/slider_closure.h"

#include <algorithm>
#include <cmath>

#include "contact/coulomb_march.h"

namespace fretwave::contact {

namespace {

/// Rounding of a march, relative to the size of its motion.
constexpr double rounding = 1e-14;
constexpr double touching = 1e-7;  // sine between two discs' directions: half the digits are left
constexpr int most_discs = 100, most_periods = 60;

}  // namespace

SliderClosure::SliderClosure(int samples, int pairs)
    : rest(2 * size_t(pairs)),
      first(rest.size()),
      slope(pairs),
      samples_(samples),
      pairs_(pairs),
      discs_(size_t(3) * samples * pairs),
      size_(pairs),
      cycles_(pairs) {}

SliderClosure::Disc SliderClosure::disc(int sample, int pair) const {
  double const* at = discs_.data() + size_t(3) * sample * pairs_ + pair;
  return {{at[0], at[pairs_]}, at[2 * pairs_], sample};
}

/// Distance squared less radius squared of a point that is on the disc's edge but for rounding: that of the
/// motion, which may be far larger than the disc.
double SliderClosure::touches(Disc const& d, int pair) const { return 2 * rounding * size_[pair] * d.radius; }

void SliderClosure::close(std::vector<double>& w, std::vector<SliderStart>& starts) {
  extent(samples_, pairs_, discs_.data(), size_.data());
  shake_down(w, starts);
  cycle(w, starts);
}

/// Add the disc that the point is farthest outside of until there is none: a linear-programming-type problem,
/// every step takes the point farther from rest.
void SliderClosure::shake_down(std::vector<double>& w, std::vector<SliderStart>& starts) {
  std::vector<Nearest> nearest(pairs_);
  std::vector<double> excess(pairs_), sample(pairs_);
  for (int i = 0; i < pairs_; ++i) nearest[i].at = {rest[i], rest[pairs_ + i]};
  for (int step = 0, left = pairs_; step < most_discs && left; ++step) {
    for (int i = 0; i < pairs_; ++i) w[i] = nearest[i].at.x, w[pairs_ + i] = nearest[i].at.y;
    farthest(samples_, pairs_, discs_.data(), w.data(), excess.data(), sample.data());
    for (int i = 0; i < pairs_; ++i) {
      Nearest& now = nearest[i];
      if (!now.searching) continue;
      const Disc farthest_out = disc(int(sample[i]), i);
      const bool inside = excess[i] <= touches(farthest_out, i);
      if (!inside) now.empty = !enter(now, farthest_out, i);
      now.searching = !inside && !now.empty;
      left -= !now.searching;
    }
  }
  for (int i = 0; i < pairs_; ++i) {
    cycles_[i] = nearest[i].empty || nearest[i].searching;
    if (!cycles_[i]) starts[i] = follow(nearest[i], i);
  }
}

/// Nearest point to rest on the new disc and inside the active ones; false if they have none in common.
bool SliderClosure::enter(Nearest& now, Disc const& added, int pair) const {
  const Point origin{rest[pair], rest[pairs_ + pair]};
  Nearest best;
  double least = std::numeric_limits<double>::infinity();
  const auto offer = [&](Point at, std::vector<Disc> active) {
    for (Disc const& d : now.active)
      if (std::pow(at.x - d.centre.x, 2) + std::pow(at.y - d.centre.y, 2) - d.radius * d.radius >
          touches(d, pair))
        return;
    const double distance = std::hypot(at.x - origin.x, at.y - origin.y);
    if (distance < least) least = distance, best.at = at, best.active = std::move(active);
  };
  const Point u = added.centre;
  const double away = std::hypot(origin.x - u.x, origin.y - u.y), s = added.radius / away;
  if (away > added.radius) offer({u.x + s * (origin.x - u.x), u.y + s * (origin.y - u.y)}, {added});
  for (Disc const& d : now.active) {
    // the circles meet at `along` from u on the line of centres, `across` to either side
    const double x = d.centre.x - u.x, y = d.centre.y - u.y, apart2 = x * x + y * y;
    const double R2 = added.radius * added.radius;
    const double along = (1 + (R2 - d.radius * d.radius) / apart2) / 2, across2 = R2 / apart2 - along * along;
    if (!(across2 >= 0)) continue;
    for (const double across : {std::sqrt(across2), -std::sqrt(across2)})
      offer({u.x + along * x - across * y, u.y + along * y + across * x}, {added, d});
  }
  if (best.active.empty()) return false;
  now = best;
  return true;
}

/// On one disc w = u + R (rest - u)/|rest - u|; on two e_k (dw - du_k) + dR_k = 0 with e_k from w to u_k.
SliderStart SliderClosure::follow(Nearest const& now, int pair) const {
  SliderStart out;
  double e[2][2] = {};
  for (size_t k = 0; k < now.active.size(); ++k) {
    Disc const& d = now.active[k];
    const double x = d.centre.x - now.at.x, y = d.centre.y - now.at.y, length = std::hypot(x, y);
    e[k][0] = x / length, e[k][1] = y / length, out.sample[k] = d.sample;
  }
  if (now.active.size() == 1) {
    Disc const& d = now.active[0];
    const double s = d.radius / std::hypot(rest[pair] - d.centre.x, rest[pairs_ + pair] - d.centre.y);
    for (int row = 0; row < 2; ++row) {
      out.gain[0][row][0] = -slope[pair] * e[0][row];
      for (int col = 0; col < 2; ++col)
        out.gain[0][row][col + 1] = (row == col) - s * ((row == col) - e[0][row] * e[0][col]);
    }
  } else if (now.active.size() == 2) {
    const double det = e[0][0] * e[1][1] - e[0][1] * e[1][0];
    if (std::abs(det) < touching) {  // they have one point in common, which moves along the line of centres
      for (int row = 0; row < 2; ++row) {
        out.gain[0][row][0] = -slope[pair] * e[0][row];
        for (int col = 0; col < 2; ++col) out.gain[0][row][col + 1] = e[0][row] * e[0][col];
      }
      return out;
    }
    const double inverse[2][2] = {{e[1][1] / det, -e[0][1] / det}, {-e[1][0] / det, e[0][0] / det}};
    for (int k = 0; k < 2; ++k)
      for (int row = 0; row < 2; ++row) {
        out.gain[k][row][0] = -slope[pair] * inverse[row][k];
        for (int col = 0; col < 2; ++col) out.gain[k][row][col + 1] = inverse[row][k] * e[k][col];
      }
  }
  return out;
}

/// Keep these lanes of rows of n: places in the order kept, the same in all rows.
void SliderClosure::keep(std::vector<int> const& lanes, int n, std::vector<double>& rows) {
  const size_t count = rows.size() / n;
  double* to = rows.data();
  for (size_t row = 0; row < count; ++row)
    for (const int lane : lanes) *to++ = rows[row * n + lane];
  rows.resize(count * lanes.size());
}

/// Newton for w = P(w) with the exact A = dP/dw; dw = A dw + b then gives the tangent. Near the onset of slip
/// a good step leaves a large residual that one period P removes, so a step is judged after it; a step that
/// fails is halved from P of the last good point, which is never worse than that. Pairs that are closed
/// leave.
void SliderClosure::cycle(std::vector<double>& w, std::vector<SliderStart>& starts) {
  enum Kind { newton, smoothed, plain };
  struct State {
    int pair;
    Kind kind = plain;
    double after[2] = {}, least = 0, damping = 1;  ///< P of the last good point, its residual
  };
  std::vector<State> states;
  std::vector<int> lanes;
  for (int i = 0; i < pairs_; ++i)
    if (cycles_[i]) lanes.push_back(i), states.push_back({.pair = i});
  std::vector<double> at = first, end, A;
  for (int step = 0, n = pairs_; step < most_periods && !lanes.empty(); ++step) {
    if (int(lanes.size()) < n) keep(lanes, n, discs_), keep(lanes, n, at);
    n = int(lanes.size());
    lanes.clear(), end.resize(at.size()), A.resize(4 * size_t(n));
    shoot(samples_, n, discs_.data(), at.data(), end.data(), A.data());
    for (int j = 0; j < n; ++j) {
      State now = states[j];
      SliderStart& start = starts[now.pair];
      const double r[2] = {end[j] - at[j], end[n + j] - at[n + j]}, size = std::hypot(r[0], r[1]);
      const double a = 1 - A[j], b = -A[n + j], c = -A[2 * n + j], d = 1 - A[3 * n + j];
      const double det =
          std::max(a * d - b * c, rounding);  // A contracts: det >= 0, and 0 at the onset of slip
      start.periodic[0][0] = d / det, start.periodic[0][1] = -b / det;
      start.periodic[1][0] = -c / det, start.periodic[1][1] = a / det;
      for (int row = 0; row < 2; ++row) w[row * pairs_ + now.pair] = at[row * n + j];
      if (size <= rounding * size_[now.pair]) continue;
      if (now.kind == plain || size < now.least) {
        now.damping = now.kind == plain ? now.damping : std::min(1.0, 2 * now.damping);
        now.kind = newton, now.least = size;
        for (int row = 0; row < 2; ++row) {
          now.after[row] = end[row * n + j];
          at[row * n + j] += now.damping * (start.periodic[row][0] * r[0] + start.periodic[row][1] * r[1]);
        }
      } else {
        now.kind = now.kind == newton ? smoothed : plain;
        if (now.kind == plain) now.damping /= 2;
        for (int row = 0; row < 2; ++row)
          at[row * n + j] = now.kind == smoothed ? end[row * n + j] : now.after[row];
      }
      states[lanes.size()] = now;
      lanes.push_back(j);
    }
  }
}

}  // namespace fretwave::contact
