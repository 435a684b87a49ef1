#include "contact/coulomb_3d.h"

#include <algorithm>
#include <cmath>

#include "contact/coulomb_march.h"
#include "contact/slider_closure.h"

namespace fretwave::contact {

Integration Coulomb3d::integration() const {
  const bool slides = std::ranges::all_of(p_.friction_coefficient, [](double mu) { return mu == 0; });
  return slides ? Integration::pieces : Integration::circle;
}

/// A march of one sample.
void Coulomb3d::set_rest(double const* u) {
  const int n = pairs();
  std::vector<double> f(3 * size_t(n)), record(record_arrays * size_t(n));
  march(constants(0), 1, n, u, slider_.data(), f.data(), record.data());
  for (int i = 0; i < n; ++i) closed_[i] = f[i] > 0;
}

void Coulomb3d::force(Motion const& motion, double* f, Record& record) const {
  const int n = motion.pairs, samples = motion.samples;
  const PairConstants p = constants(motion.first);
  std::vector<double> w(2 * size_t(n));
  for (int i = 0; i < 2 * n; ++i) w[i] = slider_[(i < n ? 0 : pairs() - n) + motion.first + i];
  const std::vector<double> rest = w;
  record.march.resize(size_t(record_arrays) * samples * n);
  record.start.assign(n, {}), record.unclosed = 0;
  march(p, samples, n, motion.u, w.data(), f, record.march.data());
  std::vector<double> left(n);
  left_rest(samples, n, record.march.data(), left.data());
  // pulled in as the period began
  for (int i = 0; i < n; ++i) left[i] = w[i] != rest[i] || w[n + i] != rest[n + i] ? 1.0 : left[i];
  if (std::ranges::count(left, 0.0) == n) return;
  close(motion, rest, left, f, w, record);
  const std::vector<double> closed = w;
  march(p, samples, n, motion.u, w.data(), f, record.march.data());
  for (int i = 0; i < 2 * n; ++i) record.unclosed = std::max(record.unclosed, std::abs(w[i] - closed[i]));
}

/// Periodic sliders of the pairs that slipped or opened (`left`), wherever their slider w ended: it follows
/// the motion even where it has come back to its rest. One that opens forgets all before, and is closed.
void Coulomb3d::close(Motion const& motion, std::vector<double> const& rest, std::vector<double> const& left,
                      double const* f, std::vector<double>& w, Record& record) const {
  const int n = motion.pairs;
  std::vector<double> least(n, std::numeric_limits<double>::infinity());
  for (int t = 0; t < motion.samples; ++t)
    for (int i = 0; i < n; ++i) least[i] = std::min(least[i], f[size_t(t) * 3 * n + i]);
  std::vector<int> chosen;
  for (int i = 0; i < n; ++i) {
    if (left[i] == 0) continue;
    if (least[i] * reach_[motion.first + i] > 0)
      chosen.push_back(i);
    else
      for (int c = 0; c < 2; ++c) record.start[i].periodic[c][c] = 1;
  }
  if (chosen.empty()) return;
  const int k = int(chosen.size());
  SliderClosure closure(motion.samples, k);
  for (int t = 0; t < motion.samples; ++t) {
    double* disc = closure.disc(t);
    double const *u = motion.u + size_t(t) * 3 * n, *now = f + size_t(t) * 3 * n;
    for (int j = 0; j < k; ++j) {
      const int i = chosen[j];
      disc[j] = u[n + i], disc[k + j] = u[2 * n + i], disc[2 * k + j] = reach_[motion.first + i] * now[i];
    }
  }
  std::vector<double> closed(2 * size_t(k));
  std::vector<SliderStart> starts(k);
  for (int j = 0; j < 2 * k; ++j) {
    const int i = j < k ? chosen[j] : n + chosen[j - k];
    closure.rest[j] = rest[i], closure.first[j] = w[i];
    if (j < k) closure.slope[j] = reach_[motion.first + i] * p_.normal_stiffness[motion.first + i];
  }
  closure.close(closed, starts);
  for (int j = 0; j < k; ++j) {
    w[chosen[j]] = closed[j], w[n + chosen[j]] = closed[k + j];
    record.start[chosen[j]] = starts[j];
  }
}

/// dw at the period's start, then the march of the closed period; `pair` as in linear_march.
void Coulomb3d::linearised(Motion const& motion, Record const& record, int pair, int n, double const* du,
                           double* df) const {
  const PairConstants p = constants(motion.first);
  std::vector<double> dw(2 * size_t(n), 0.0);
  const auto start = [&](int i) -> SliderStart const& { return record.start[pair < 0 ? i : pair]; };
  bool periodic = false;
  for (int i = 0; i < (pair < 0 ? n : 1); ++i)
    periodic = periodic || std::any_of(&start(i).periodic[0][0], &start(i).periodic[0][0] + 4,
                                       [](double x) { return x != 0; });
  if (periodic)
    linear_march(p, motion.samples, motion.pairs, pair, n, record.march.data(), du, dw.data(), nullptr);
  for (int i = 0; i < n; ++i) {
    SliderStart const& s = start(i);
    const double b[2] = {dw[i], dw[n + i]};
    for (int row = 0; row < 2; ++row) {
      double sum = s.periodic[row][0] * b[0] + s.periodic[row][1] * b[1];
      for (int k = 0; k < 2; ++k)
        for (int c = 0; c < 3; ++c) sum += s.gain[k][row][c] * du[(size_t(s.sample[k]) * 3 + c) * n + i];
      dw[row * n + i] = sum;
    }
  }
  linear_march(p, motion.samples, motion.pairs, pair, n, record.march.data(), du, dw.data(), df);
}

void Coulomb3d::product(Motion const& motion, Record const& record, double const* du, double const*,
                        double* df) const {
  linearised(motion, record, -1, motion.pairs, du, df);
}

void Coulomb3d::pair_product(Motion const& motion, Record const& record, int pair, int columns,
                             double const* du, double* df) const {
  linearised(motion, record, pair, columns, du, df);
}

/// Without friction: which samples are open. With it slip turns within its piece, and a slider in shakedown
/// touches its limit by rounding: pieces have no sharp ends there.
std::uint64_t Coulomb3d::piece(Motion const& motion, Record const& record) const {
  const int n = motion.pairs;
  if (std::ranges::any_of(p_.friction_coefficient, [](double mu) { return mu > 0; })) return 0;
  std::vector<double> states(size_t(motion.samples) * n);
  double const* r = record.march.data();
  for (int t = 0; t < motion.samples; ++t, r += record_arrays * n)
    for (int i = 0; i < n; ++i) states[size_t(t) * n + i] = r[i] >= 0;
  return number_of(states, motion.first);
}

Entry coulomb_3d_entry() {
  return coulomb_entry("coulomb_3d",
                       "elastic Coulomb contact with variable normal load and lift-off, circular slip limit",
                       3, [](CoulombParameters p) { return std::make_unique<Coulomb3d>(std::move(p)); });
}

}  // namespace fretwave::contact
