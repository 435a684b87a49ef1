#include "hb/circular_contact.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "hb/indicator.h"
#include "lapack.h"

namespace fretwave::hb {

namespace {

/// values (count) = waves (count x m) block
void evaluate(std::vector<double> const& waves, int m, double const* block, double* values) {
  const int count = int(waves.size()) / m, step = 1;
  const double one = 1, zero = 0;
  dgemv_("T", &m, &count, &one, waves.data(), &m, block, &step, &zero, values, &step);
}

}  // namespace

CircularContact::CircularContact(Harmonics const& h, contact::Law const& law)
    : harmonics_(h),
      law_(law),
      grid_(h),
      times_(search_times(h).samples()),
      search_(size_t(times_) * h.block_size()),
      pairs_(law.pairs()) {
  for (int t = 0; t < times_; ++t) waves(h, period * t / times_, &search_[size_t(t) * h.block_size()]);
}

void CircularContact::force(double const* U, double const*, double* F) {
  blocks_.made = false;
  const int m = harmonics_.block_size();
  for (size_t k = 0; k < pairs_.size(); ++k, U += size(), F += size()) {
    Pair& pair = pairs_[k];
    const double sum = std::accumulate(U, U + 3 * m, 0.0, [](double a, double b) { return a + std::abs(b); });
    if (!std::isfinite(sum)) {  // a step of Newton's that fails
      pair.slider.clear(), pair.normal.spans.clear();
      std::fill_n(F, size(), sum);
      continue;
    }
    pair.law = law_.linear_pair(int(k));
    take(U, pair.law, pair.normal);
    find(U, pair);
    std::fill_n(F, size(), 0.0);
    pair.normal.add_force(harmonics_, F);
    add_friction(pair, F + m);
  }
}

/// A pair's motion, and when it is closed.
void CircularContact::take(double const* U, contact::LinearPair const& law, NormalContact& normal) const {
  normal.take(harmonics_, law, U);
  Series const& approach = normal.approach;
  normal.spans.clear(), normal.closed = approach.q[0].real() > approach.bound();
  if (normal.closed) return;
  std::vector<double> values(times_);
  evaluate(search_, harmonics_.block_size(), U, values.data());
  for (double& value : values) value += law.interference();
  normal.find_spans(values.data(), times_);
}

/// Its slider, closed over the period.
void CircularContact::find(double const* U, Pair& pair) {
  SliderPeriod& slider = pair.slider;
  slider.clear();
  contact::LinearPair const& law = pair.law;
  if (!(law.friction_coefficient > 0) || !pair.normal.touches()) return;
  const int m = harmonics_.block_size();
  MovingDisc& disc = pair.disc;
  disc.grid = &grid_, disc.radius = pair.normal.approach;
  for (auto& q : disc.radius.q) q *= law.reach();
  double rest[2], swing = 0;
  for (int c = 0; c < 2; ++c) {
    disc.u[c] = series(harmonics_, U + (c + 1) * m), pair.mean[c] = mean(harmonics_, U + (c + 1) * m);
    rest[c] = law.slider[c] - pair.mean[c];
    swing += disc.u[c].bound();
  }
  const double least = disc.radius.q[0].real() - disc.radius.bound();
  if (std::abs(rest[0]) + std::abs(rest[1]) + swing < least) return slider.rest_at(rest);
  take_nodes(U, pair);
  if (pair.normal.closed)
    slider.close(disc, {rest[0], rest[1]});
  else
    slider.close(disc, pair.normal.spans);
}

/// Values and rates at the grid's nodes.
void CircularContact::take_nodes(double const* U, Pair& pair) {
  const int m = harmonics_.block_size(), nodes = grid_.nodes();
  const bool mean = harmonics_.orders()[0] == 0;
  std::vector<double> block(U, U + 3 * m), at(6 * size_t(nodes));
  for (int c = 0; c < 3; ++c) {
    if (mean) block[size_t(c) * m] = 0;
    evaluate(grid_.waves(), m, &block[size_t(c) * m], &at[size_t(c) * nodes]);
    evaluate(grid_.rates(), m, &block[size_t(c) * m], &at[size_t(c + 3) * nodes]);
  }
  const double reach = pair.law.reach(), R = pair.disc.radius.q[0].real();
  pair.disc.at_nodes.resize(nodes);
  double const* x = at.data();
  for (int k = 0; k < nodes; ++k, ++x)
    pair.disc.at_nodes[k] = {
        {x[nodes], x[2 * nodes]}, {x[4 * nodes], x[5 * nodes]}, R + reach * x[0], reach * x[3 * nodes]};
}

/// T = kt (u - w) in stick, in closed form; kt R e in slip, at the nodes.
void CircularContact::add_friction(Pair const& pair, double* F) const {
  const int m = harmonics_.block_size();
  SliderPeriod const& slider = pair.slider;
  const double kt = pair.law.tangential_stiffness;
  if (slider.kind == SliderPeriod::Kind::loose) return;
  if (slider.stands()) {
    for (int c = 0; c < 2; ++c, F += m) {
      add_series(harmonics_, pair.disc.u[c], kt, F);
      add_mean(harmonics_, -kt * slider.w[c], F);
    }
    return;
  }
  Indicator stick(harmonics_), stands[2] = {Indicator(harmonics_), Indicator(harmonics_)};
  Arc arc;
  for (SweptSlider::Stick const& piece : slider.path.sticks) {
    arc.set(2 * harmonics_.highest(), piece.begin, piece.length);
    stick.add(arc, 1);
    for (int c = 0; c < 2; ++c) {
      stands[c].add(arc, -piece.w[c]);
      add_mean(harmonics_, kt / period * arc.integral(pair.disc.u[c]), F + c * m);
    }
  }
  for (int c = 0; c < 2; ++c) {
    stick.add_product(pair.disc.u[c], kt, F + c * m);
    stands[c].add_coefficients(kt, F + c * m);
  }
  std::vector<double> other(m);
  const double mean = harmonics_.orders()[0] == 0 ? 0.5 : 1;
  for (SweptSlider::Slip const& piece : slider.path.slips) {
    const int first = grid_.first_node(piece.begin, piece.length);
    for (int j = 0; j < Radau::stages; ++j) {
      const std::array<double, 2> e = piece.direction(j);
      const double weight = piece.length * radau().weights[j] / std::numbers::pi;
      if (first < 0) waves(harmonics_, piece.begin + radau().nodes[j] * piece.length, other.data());
      double const* wave = first < 0 ? other.data() : &grid_.waves()[size_t(first + j) * m];
      for (int c = 0; c < 2; ++c) {
        const double force = kt * piece.at[j].R * e[c] * weight;
        F[c * m] += force * mean * wave[0];
        for (int k = 1; k < m; ++k) F[c * m + k] += force * wave[k];
      }
    }
  }
}

}  // namespace fretwave::hb
