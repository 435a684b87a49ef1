#include "hb/moving_disc.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fretwave::hb {

namespace {

constexpr double period = 2 * std::numbers::pi;

}  // namespace

/// Three panels in the shortest wave: the product of force and wave goes through 2/3 of its own in each.
PanelGrid::PanelGrid(Harmonics const& h) : panels_(3 * (h.highest() + 1)), length_(period / panels_) {
  const int m = h.block_size();
  waves_.assign(size_t(nodes()) * m, 1.0), rates_.assign(waves_.size(), 0.0);
  for (int k = 0; k < nodes(); ++k)
    for (int i = 0; i < h.count(); ++i)
      if (const int n = h.orders()[i]) {
        const double c = std::cos(n * time(k)), s = std::sin(n * time(k));
        const size_t at = size_t(k) * m + h.offset(i);
        waves_[at] = c, waves_[at + 1] = s, rates_[at] = -n * s, rates_[at + 1] = n * c;
      }
}

double PanelGrid::time(int node) const {
  const int stage = node % Radau::stages;
  const double panel = node / Radau::stages;
  return (panel + radau().nodes[stage]) * length_;
}

MovingDisc::Instant MovingDisc::at(double tau) const {
  const Series::Jet x = u[0].at(tau), y = u[1].at(tau), r = radius.at(tau);
  return {{x.d[0], y.d[0]}, {x.d[1], y.d[1]}, r.d[0], r.d[1]};
}

MovingDisc::Excess MovingDisc::excess(double tau, Instant const& now, double const* w) {
  const double x = now.u[0] - w[0], y = now.u[1] - w[1];
  return {tau, x * x + y * y - now.R * now.R, 2 * (x * now.v[0] + y * now.v[1] - now.R * now.dR), 0};
}

MovingDisc::Excess MovingDisc::excess(double tau, double const* w) const {
  const Series::Jet x = u[0].at(tau), y = u[1].at(tau), r = radius.at(tau);
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

double MovingDisc::exit(double begin, double end, double const* w, bool at_edge) const {
  const auto rising = [&](double low, double high) {
    const auto f = [&](double tau) {
      const Excess now = excess(tau, w);
      return std::pair(now.value, now.rate);
    };
    return root(f, low, high, high, 1, 1);
  };
  Excess before = excess(begin, w);
  // what says otherwise is rounding
  before.value = std::min(before.value, 0.0);
  if (at_edge) before.rate = std::min(before.rate, 0.0);
  const int stages = Radau::stages, panel = int(std::floor(begin / grid->length()));
  for (int k = panel * stages; before.tau < end; ++k) {
    const double tau = grid->time(k);
    if (tau <= begin) continue;
    const Excess after = tau < end ? excess(tau, node(k), w) : excess(end, w);
    if (after.value > 0) return rising(before.tau, after.tau);
    if (before.rate > 0 && after.rate < 0 && room(before, after) > 0) {
      const Excess top = highest(before, after, w);
      if (top.value > 0) return rising(before.tau, top.tau);
    }
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
