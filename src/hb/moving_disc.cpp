#include "hb/moving_disc.h"

#include <algorithm>
#include <cmath>

namespace fretwave::hb {

/// Three panels in the shortest wave: the product of force and wave goes through 2/3 of its own in each.
PanelGrid::PanelGrid(Harmonics const& h) : panels_(3 * (h.moving() + 1)), length_(period / panels_) {
  const int m = h.block_size();
  waves_.resize(size_t(nodes()) * m), rates_.resize(waves_.size());
  for (int k = 0; k < nodes(); ++k) {
    double* now = &waves_[size_t(k) * m];
    hb::waves(h, time(k), now), hb::rates(h, now, &rates_[size_t(k) * m]);
  }
}

double PanelGrid::time(int node) const {
  const int stage = node % Radau::stages;
  const double panel = node / Radau::stages;
  return (panel + radau().nodes[stage]) * length_;
}

int PanelGrid::first_node(double begin, double length) const {
  constexpr double rounding = 1e-12;
  const double panel = begin / length_, number = std::round(panel);
  const bool here = std::abs(length - length_) <= rounding * length_ && std::abs(panel - number) <= rounding;
  return here && number >= 0 ? int(number) % panels_ * Radau::stages : -1;
}

MovingDisc::Instant MovingDisc::at(double tau) const {
  const auto [x, y, r] = jets(tau);
  return {{x.d[0], y.d[0]}, {x.d[1], y.d[1]}, r.d[0], r.d[1]};
}

MovingDisc::Excess MovingDisc::excess(double tau, Instant const& now, double const* w) {
  const double x = now.u[0] - w[0], y = now.u[1] - w[1];
  return {tau, x * x + y * y - now.R * now.R, 2 * (x * now.v[0] + y * now.v[1] - now.R * now.dR), 0};
}

MovingDisc::Excess MovingDisc::excess(double tau, double const* w) const {
  const auto [x, y, r] = jets(tau);
  Excess out = excess(tau, {{x.d[0], y.d[0]}, {x.d[1], y.d[1]}, r.d[0], r.d[1]}, w);
  const double speed2 = x.d[1] * x.d[1] + y.d[1] * y.d[1] - r.d[1] * r.d[1];
  out.bend = 2 * (speed2 + (x.d[0] - w[0]) * x.d[2] + (y.d[0] - w[1]) * y.d[2] - r.d[0] * r.d[2]);
  return out;
}

/// The maximum between two times, the first rising and the second falling.
MovingDisc::Excess MovingDisc::highest(Excess const& before, Excess const& after, double const* w) const {
  const auto f = [&](double tau) {
    const Excess now = excess(tau, w);
    return std::pair(now.rate, now.bend);
  };
  const double guess =
      before.tau + (after.tau - before.tau) * (before.rate / std::max(before.rate - after.rate, 1e-300));
  return excess(root(f, before.tau, after.tau, guess, -1, 1), w);
}

/// Where both tangents of two nodes leave room for it there is a maximum between them.
double MovingDisc::room(Excess const& before, Excess const& after) {
  if (!(before.rate > 0 && after.rate < 0)) return std::max(before.value, after.value);
  const double step = after.tau - before.tau;
  return before.value +
         before.rate * (after.value - before.value - after.rate * step) / (before.rate - after.rate);
}

MovingDisc::Excess MovingDisc::farthest(double const* w) const {
  const int count = int(at_nodes.size());
  Excess before = excess(grid->time(count - 1) - period, at_nodes[count - 1], w), most = before;
  for (int k = 0; k < count; ++k) {
    const Excess now = excess(grid->time(k), at_nodes[k], w);
    if (now.value > most.value) most = now;
    if (before.rate > 0 && now.rate < 0 && room(before, now) > most.value) {
      const Excess top = highest(before, now, w);
      if (top.value > most.value) most = top;
    }
    before = now;
  }
  return most;
}

namespace {

/// First time between two at which a slider that stands comes to the edge: however short it is outside, for
/// its excess bends down by no more than 2 (|d| |u''| + R'^2 + R |R''|).
struct Exit {
  MovingDisc const& disc;
  double const* w;
  double bend_u = std::hypot(disc.u[0].bound(2), disc.u[1].bound(2)), bend_R = disc.radius.bound(2);
  struct Probe {
    MovingDisc::Excess excess;
    double arm, R, dR;
  };
  Probe probe(double tau, MovingDisc::Instant const& at) const {
    return {MovingDisc::excess(tau, at, w), std::hypot(at.u[0] - w[0], at.u[1] - w[1]), at.R,
            std::abs(at.dR)};
  }

  /// Time over which a slider at the edge, E = 0 and E' <= 0, is surely not dragged: there E, of the size of
  /// its own rounding, says nothing. While |d| <= R,
  ///   E <= s (E' + s (E'' / 2 + s E3 / 6)), |E'''| <= E3 = 2 (3 |u'| |u''| + R |u'''| + 3 |R'| |R''| + R
  ///   |R'''|).
  double rests_for(MovingDisc::Excess const& edge) const {
    Series const& r = disc.radius;
    const auto u = [&](int order) { return std::hypot(disc.u[0].bound(order), disc.u[1].bound(order)); };
    const double a =
        u(1) * bend_u + r.bound(1) * bend_R + (std::abs(r.q[0].real()) + r.bound()) * (u(3) + r.bound(3)) / 3;
    const double b = edge.bend / 2, c = std::min(edge.rate, 0.0), root = std::sqrt(b * b - 4 * a * c);
    if (!(a > 0 && root > 0)) return 0;
    return b < 0 ? (root - b) / (2 * a) : -2 * c / (b + root);
  }

  /// NaN if there is none.
  double between(Probe const& a, Probe const& b, int halvings) const {
    const double h = b.excess.tau - a.excess.tau;
    // between the two |d| and R are at most the larger one and their own bending; where outside, |d| = R
    const double R = std::max(a.R, b.R) + h * h * bend_R / 8, dR = std::max(a.dR, b.dR) + h * bend_R / 2;
    const double arm = std::max(a.arm, b.arm) + h * h * bend_u / 8;
    const double bend = 2 * (arm * bend_u + dR * dR + std::abs(R) * bend_R);
    const bool leaves = b.excess.value > 0;
    if (!leaves && std::max(a.excess.value, b.excess.value) + h * h * bend / 8 <= 0) return NAN;
    if (leaves && (halvings == 0 || a.excess.rate > h * bend)) return rising(a.excess.tau, b.excess.tau);
    if (halvings == 0) return NAN;
    const double middle = a.excess.tau + h / 2;
    const Probe m = probe(middle, disc.at(middle));
    const double first = between(a, m, halvings - 1);
    return std::isnan(first) && m.excess.value <= 0 ? between(m, b, halvings - 1) : first;
  }
  double rising(double low, double high) const {
    const auto f = [this](double tau) {
      const MovingDisc::Excess now = disc.excess(tau, w);
      return std::pair(now.value, now.rate);
    };
    return root(f, low, high, high, 1, 1);
  }
};

}  // namespace

double MovingDisc::exit(double begin, double end, double const* w, bool at_edge) const {
  constexpr int most = 10;
  const Exit search{*this, w};
  if (at_edge) begin += search.rests_for(excess(begin, w)) / 2;
  if (begin >= end) return end;
  Exit::Probe before = search.probe(begin, at(begin));
  // what says otherwise is rounding
  before.excess.value = std::min(before.excess.value, 0.0);
  if (at_edge) before.excess.rate = std::min(before.excess.rate, 0.0);
  const int stages = Radau::stages, panel = int(std::floor(begin / grid->length()));
  for (int k = panel * stages; before.excess.tau < end; ++k) {
    const double tau = grid->time(k);
    if (tau <= begin) continue;
    const Exit::Probe after = tau < end ? search.probe(tau, node(k)) : search.probe(end, at(end));
    const double out = search.between(before, after, most);
    if (!std::isnan(out)) return out;
    if (after.excess.value > 0) return after.excess.tau;
    before = after;
  }
  return end;
}

double MovingDisc::size() const {
  double out = 0;
  for (Instant const& now : at_nodes) out = std::max(out, std::abs(now.u[0]) + std::abs(now.u[1]) + now.R);
  return out;
}

}  // namespace fretwave::hb
