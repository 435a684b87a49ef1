/// Derivatives of friction on a circle in continuous time.
#include <numbers>

#include "hb/circular_contact.h"
#include "hb/indicator.h"
#include "hb/slider_derivative.h"
#include "lapack.h"

namespace fretwave::hb {

void CircularContact::linearise() {
  const size_t n = size(), m = harmonics_.block_size();
  blocks_.clear(pairs_.size(), int(n));
  for (size_t k = 0; k < pairs_.size(); ++k) {
    double *D = blocks_.of(k), *by_gap = blocks_.by_gap_of(k);
    pairs_[k].normal.add_blocks(harmonics_, D, n, by_gap);
    if (pairs_[k].slider.stands())
      add_standing_blocks(pairs_[k], D + m * n, by_gap + m);
    else if (pairs_[k].slider.kind != SliderPeriod::Kind::loose)
      add_friction_blocks(pairs_[k], D + m * n, by_gap + m);
  }
}

/// dT = kt (du - dw) with w at rest, or as its discs hold it.
void CircularContact::add_standing_blocks(Pair const& pair, double* D, double* by_gap) const {
  const int m = harmonics_.block_size(), n = int(size());
  const double kt = pair.law.tangential_stiffness;
  for (int k = 0; k < 2 * m; ++k) D[size_t(k) * n + m + k] += kt;
  SliderPeriod const& slider = pair.slider;
  if (slider.kind != SliderPeriod::Kind::shaken || harmonics_.orders()[0] != 0) return;
  SliderDerivative derivative(harmonics_, pair.law.reach());
  for (int held = 0; held < slider.touching; ++held) {
    derivative.set_time(slider.times[held]);
    for (int c = 0; c < 2; ++c) {
      std::vector<double> dw(derivative.columns());
      double const* gain = slider.gain[held][c];
      derivative.add_value(dw.data(), gain + 1, gain[0]);
      derivative.add_rate(dw.data(), slider.gain_of_rates[c] + 1, slider.gain_of_rates[c][0]);
      for (int k = 0; k < n; ++k) D[size_t(c) * m * n + k] -= kt * dw[k];
      by_gap[c * m] -= kt * dw[n];
    }
  }
}

/// dT = kt (du - dw) in stick, kt (dR e + R de) in slip; a cycle's slider moves at the period's begin by dw
/// = b + A dw.
void CircularContact::add_friction_blocks(Pair const& pair, double* D, double* by_gap) const {
  const int m = harmonics_.block_size(), n = int(size());
  SliderPeriod const& slider = pair.slider;
  const double kt = pair.law.tangential_stiffness, one = 1;
  SliderDerivative derivative(harmonics_, pair.law.reach());
  derivative.go(slider.path, pair.disc);
  const int columns = derivative.columns(), two = 2 * columns;
  // rows of both tangents, m x columns each
  std::vector<double> all(2 * size_t(m) * columns);
  for (int c = 0; c < 2 && derivative.nodes; ++c) {
    const double factor = kt / std::numbers::pi;
    dgemm_("N", "T", &columns, &m, &derivative.nodes, &factor, derivative.arms.data() + c * columns, &two,
           derivative.weights.data(), &m, &one, &all[size_t(c) * m * columns], &columns);
    if (harmonics_.orders()[0] == 0)
      for (int k = 0; k < columns; ++k) all[size_t(c) * m * columns + k] /= 2;
  }
  Indicator stick(harmonics_);
  Arc arc;
  for (size_t k = 0; k < slider.path.sticks.size(); ++k) {
    SweptSlider::Stick const& piece = slider.path.sticks[k];
    arc.set(2 * harmonics_.highest(), piece.begin, piece.length);
    stick.add(arc, 1);
    Indicator here(harmonics_);
    here.add(arc, 1);
    std::vector<double> force(m);
    here.add_coefficients(-kt, force.data());
    for (int c = 0; c < 2; ++c)
      for (int r = 0; r < m; ++r)
        for (int j = 0; j < columns; ++j)
          all[(size_t(c) * m + r) * columns + j] += force[r] * derivative.sticks[k][size_t(c) * columns + j];
  }
  double const* b[2] = {derivative.end(), derivative.end() + columns};
  double periodic[2][2];
  SliderPeriod::invert({{b[0][n + 1], b[0][n + 2]}, {b[1][n + 1], b[1][n + 2]}}, periodic);
  for (int r = 0; r < 2 * m; ++r) {
    double* row = &all[size_t(r) * columns];
    if (slider.kind == SliderPeriod::Kind::cycles) {
      double by_start[2];
      for (int k = 0; k < 2; ++k) by_start[k] = row[n + 1] * periodic[0][k] + row[n + 2] * periodic[1][k];
      for (int j = 0; j <= n; ++j) row[j] += by_start[0] * b[0][j] + by_start[1] * b[1][j];
    }
    for (int j = 0; j < n; ++j) D[size_t(r) * n + j] += row[j];
    by_gap[r] += row[n];
  }
  for (int c = 0; c < 2; ++c) stick.add_multiplication(kt, D + size_t(c) * m * n + (c + 1) * m, n);
}

}  // namespace fretwave::hb
